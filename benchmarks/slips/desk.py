"""The files of a first-time user: tables of a UR and a KUKA, photographs, and the commands to type.

Tables are written with SciPy's rotations and the standard library, not with the code that reads them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from scipy.spatial.transform import Rotation
from tests.journeys.raw import BOARD_OPTIONS, cell, photographs, recorded

from basecal.geometry import SE3, Array
from basecal.simulation import SimulatedCell

SAMPLES = 16
CELL = "mycell"
UR_HEADER, KUKA_HEADER = "x,y,z,rx,ry,rz", "X,Y,Z,A,B,C"
MATRIX_HEADER = ",".join(f"m{i}{j}" for i in range(4) for j in range(4))
Step = str | Callable[[Path], None]
"""A command, or an edit of files in the folder."""


@dataclass
class Desk:
    """Files and commands of a user, for a slip to spoil.

    Attributes:
        folder: Folder of all files.
        draw: Number of the draw, which chooses among variants of one slip.
        made: The cell, and its truth.
        ur: Recorded poses of the UR: positions (n, 3) [m] and rotations.
        kuka: Recorded poses of the KUKA.
        steps: Commands and edits before `basecal calibrate`.
        truth: Transforms to be found.
    """

    folder: Path
    draw: int
    made: SimulatedCell
    ur: tuple[Array, Rotation]
    kuka: tuple[Array, Rotation]
    steps: list[Step] = field(default_factory=list)
    truth: dict[str, SE3] = field(default_factory=dict)

    def write(self, name: str, lines: Sequence[str]) -> None:
        """Write a file of lines."""
        (self.folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")

    @property
    def photos(self) -> list[Path]:
        """All photographs in order."""
        return sorted((self.folder / "photos").iterdir())


def prepare_desk(folder: Path, draw: int) -> Desk:
    """Prepare a desk without a slip."""
    made, images = _simulate_photos(draw)
    (folder / "photos").mkdir()
    for path in images:
        os.link(path, folder / "photos" / path.name)
    desk = Desk(folder, draw, made, recorded(made, "eye"), recorded(made, "hand"))
    desk.write("ur.csv", [UR_HEADER, *ur_rows(*desk.ur)])
    desk.write("kuka.csv", [KUKA_HEADER, *kuka_rows(*desk.kuka)])
    desk.steps = [import_poses("ur"), import_poses("kuka"), import_images()]
    desk.truth = {"ur_base_from_kuka_base": made.truth["eye_base_from_hand_base"]}
    return desk


@lru_cache
def _simulate_photos(draw: int) -> tuple[SimulatedCell, tuple[Path, ...]]:
    """The cell of a draw, and its photographs."""
    made = cell(samples=SAMPLES, seed=100 + draw)
    folder = Path(mkdtemp(prefix="slips"))
    photographs(made, folder, lambda i: f"IMG_{i + 1:03d}.png")
    return made, tuple(sorted((folder / "photos").iterdir()))


def import_poses(robot: str, maker: str = "", file: str = "", options: str = "") -> str:
    """The command for a robot's table."""
    command = (
        f"basecal import poses {CELL} --robot {robot} {file or f'{robot}.csv'} --format {maker or robot} {options}"
    )
    return command.strip()


def import_images(on: str = "ur", options: str = BOARD_OPTIONS) -> str:
    """The command for the photographs."""
    return f"basecal import images {CELL} photos --camera wrist --on {on} {options}"


def ur_rows(positions: Array, turns: Rotation) -> list[str]:
    """Rows of positions in metres and rotation vectors."""
    return csv_rows(np.c_[positions, turns.as_rotvec()], 6)


def kuka_rows(positions: Array, turns: Rotation) -> list[str]:
    """Rows of positions in millimetres and angles in degrees: A about z, B about the new y, C about the new x."""
    return csv_rows(np.c_[1e3 * positions, turns.as_euler("ZYX", degrees=True)], 4)


def matrix_rows(positions: Array, turns: Rotation, is_by_column: bool = False) -> list[str]:
    """Matrices 4x4 in metres, by rows or by columns."""
    return csv_rows([(pose.T if is_by_column else pose).ravel() for pose in matrices(positions, turns)], 8)


def matrices(positions: Array, turns: Rotation) -> Array:
    """Poses as matrices, (n, 4, 4)."""
    stacked = np.tile(np.eye(4), (len(positions), 1, 1))
    stacked[:, :3, :3], stacked[:, :3, 3] = turns.as_matrix(), positions
    return stacked


def csv_rows(values: Array | Sequence[Array], digits: int, separator: str = ",") -> list[str]:
    """Rows of numbers with this number of decimals."""
    return [separator.join(f"{value:.{digits}f}" for value in row) for row in np.asarray(values)]


def change_frames(
    poses: tuple[Array, Rotation], numbers: slice, left: SE3 | None, right: SE3 | None
) -> tuple[Array, Rotation]:
    """Poses of which some are in another base frame (`left`) or of another tool frame (`right`)."""
    stacked = matrices(*poses)
    for side, is_left in ((left, True), (right, False)):
        if side is not None:
            stacked[numbers] = side.matrix @ stacked[numbers] if is_left else stacked[numbers] @ side.matrix
    return stacked[:, :3, 3], Rotation.from_matrix(stacked[:, :3, :3])


def edit(old: str, new: str) -> Callable[[Path], None]:
    """An edit of `cell.yaml` that replaces a text once."""

    def change(folder: Path) -> None:
        path = folder / CELL / "cell.yaml"
        text = path.read_text()
        if old not in text:
            raise ValueError(f"no {old!r} in {text}")
        path.write_text(text.replace(old, new, 1))

    return change
