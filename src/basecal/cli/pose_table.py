"""Tables of poses, of one robot or of one target in one camera, as `import poses` reads them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import CycloptsError

from basecal.cli.imported import finish_import, robot_entry
from basecal.cli.lens_import import known_cell
from basecal.cli.streams import Unit
from basecal.errors import FrameNotFound
from basecal.registry import CONTROLLERS

if TYPE_CHECKING:
    from basecal.exchange.controller_poses import Reading
    from basecal.exchange.importing.seen_poses import Sight

_METRES = {"m": 1.0, "mm": 1e-3}
_ADVICE = "check --length-unit and --format"


@dataclass(frozen=True)
class PoseTable:
    """A file, and how to read it.

    Attributes:
        file: As the user named it.
        convention: Whose numbers they are; what the file says by itself where None.
        unit: What lengths are in; the controller's own where None.
        deg: Whether angles are in degrees, where the controller writes radians.
        rad: The other way round.
        is_stream: Whether each row, at its time, makes a line of its own.
    """

    file: str
    convention: str | None
    unit: Unit | None
    deg: bool
    rad: bool
    is_stream: bool

    @property
    def reading(self) -> Reading:
        """The convention and the units.

        Raises:
            CycloptsError: if there is no such convention, or two units are stated.
            DatasetError: if none is stated, and the file does not say.
        """
        from basecal.exchange.controller_poses import Reading, guessed_format

        if self.convention is not None and self.convention not in CONTROLLERS:
            raise CycloptsError(msg=f"--format {FrameNotFound(self.convention, CONTROLLERS)}")
        if self.deg and self.rad:
            raise CycloptsError(msg="--deg and --rad cannot both be")
        angle = math.radians(1) if self.deg else 1.0 if self.rad else None
        length_m = None if self.unit is None else _METRES[self.unit]
        return Reading(self.convention or guessed_format(self.file), length_m, angle)


def import_robot_poses(cell: Path, robot: str, table: PoseTable, is_inverted: bool) -> int:
    """The exit code, after a robot's flange poses are in the cell.

    Args:
        cell: Its folder.
        robot: Its name in the cell.
        table: The poses of its flange in its base.
        is_inverted: Whether they are those of the base in the flange.
    """
    from basecal.exchange.controller_poses import read_controller_poses
    from basecal.exchange.importing.imported import Imported

    reading = table.reading
    rows = read_controller_poses(table.file, robot, reading, table.is_stream, is_inverted)
    base, flange = f"{robot}_base", f"{robot}_flange"
    written = f"{flange}_from_{base}, inverted," if is_inverted else f"{base}_from_{flange}"
    what = f"{len(rows)} poses {written} as of {reading.name} ({reading.words})"
    imported = Imported(table.file, what, rows, robot_entry(cell, robot), is_stream=table.is_stream)
    return finish_import(cell, imported, advice=_ADVICE)


def import_target_poses(cell: Path, table: PoseTable, sight: Sight, is_inverted: bool) -> int:
    """The exit code, after what a camera saw of a target is in the cell.

    Args:
        cell: Its folder.
        table: The poses of the target in the camera.
        sight: Names, and what carries them.
        is_inverted: Whether they are those of the camera in the target.
    """
    from basecal.exchange.controller_poses import read_pose_rows
    from basecal.exchange.importing.imported import Imported
    from basecal.exchange.importing.seen_poses import seen_rows, sight_entry

    reading = table.reading
    found = read_pose_rows(table.file, reading, table.is_stream)
    poses = found.poses.inverse() if is_inverted else found.poses
    rows = seen_rows(found.rows, poses, sight)
    written = f"{sight.target}_from_{sight.camera}, inverted," if is_inverted else f"{sight.camera}_from_{sight.target}"
    what = f"{len(rows)} poses {written} as of {reading.name} ({reading.words})"
    entry = sight_entry(known_cell(cell), sight)
    imported = Imported(table.file, what, rows, entry, is_stream=table.is_stream)
    return finish_import(cell, imported, advice=f"{_ADVICE}, and whether it takes --invert camera-from-target")
