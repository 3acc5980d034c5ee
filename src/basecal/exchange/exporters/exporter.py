"""The face of an exporter, how one is found, and what it gives of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol

from basecal.cell import Calibration, Cell
from basecal.errors import FrameNotFound, InputError, RefusedCalibration
from basecal.exchange.exports.choice import both_directions, chosen_transforms
from basecal.exchange.exports.remarks import provenance
from basecal.exchange.exports.wanted import Wanted
from basecal.registry import EXPORTERS

Takes = Literal["transform", "robot", "camera", "urdf", "joint"]


class Exporter(Protocol):
    """What a module of this folder has.

    Attributes:
        TAKES: What of a calibration it can write, what is usual first; each is an option of `basecal export`.
        PASTED: Whether people paste it: of transforms, and text.
    """

    TAKES: tuple[Takes, ...]
    PASTED: bool

    def exported(self, wanted: Wanted) -> str:
        """Text of a file for another program."""


def exporter(kind: str) -> Exporter:
    """The exporter of a registered kind."""
    module: Any = import_module(f"basecal.exchange.exporters.{kind}")
    found: Exporter = module
    return found


def export(
    calibration: Calibration,
    kind: str,
    transform: str | None = None,
    *,
    robot: str | None = None,
    camera: str | None = None,
    urdf: Sequence[Path] = (),
    joint: str | None = None,
    cell: Cell | None = None,
    folder: Path | None = None,
    run: str | None = None,
) -> str:
    """A calibration as the text of another program's file.

    Args:
        calibration: What came out.
        kind: For which program, one of `basecal.registry.EXPORTERS`.
        transform: Name of a transform, in whichever direction; those that the cell was calibrated for where None.
        robot: Whose file, for kinds that are of a robot.
        camera: Whose file, for kinds that are of a camera.
        urdf: URDFs to build on, for kinds that do.
        joint: Whose origin is replaced in one.
        cell: What was calibrated: it names frames, and some kinds need it.
        folder: Where the cell's files are.
        run: Name of the calibration's run, said in comments.

    Raises:
        FrameNotFound: if there is no such kind, transform, robot or camera.
        RefusedCalibration: if the calibration is refused.
        InputError: if what is asked for cannot be exported, or the kind does not take it.
    """
    if kind not in EXPORTERS:
        raise FrameNotFound(kind, list(EXPORTERS))
    if calibration.verdict == "refused":
        raise RefusedCalibration(next((f.message for f in calibration.findings if f.severity == "error"), ""))
    found = exporter(kind)
    named = {"transform": transform, "robot": robot, "camera": camera, "urdf": urdf, "joint": joint}
    for option, value in named.items():
        if value and option not in found.TAKES:
            raise InputError(f"{kind} takes a {' or a '.join(found.TAKES)}, not a {option}")
    of_transforms = "transform" in found.TAKES and robot is None and camera is None
    transforms = chosen_transforms(calibration, cell, transform) if of_transforms else ()
    remarks = provenance(calibration, run)
    return found.exported(Wanted(transforms, remarks, calibration, cell, folder, robot, camera, tuple(urdf), joint))


def pasteable(calibration: Calibration, cell: Cell | None = None, run: str | None = None) -> dict[str, dict[str, str]]:
    """Texts to paste: by transform, in both directions, and then by kind; none of a calibration that is refused."""
    if calibration.verdict == "refused":
        return {}
    remarks = provenance(calibration, run)
    kinds = {kind: found for kind in EXPORTERS if (found := exporter(kind)).PASTED}
    return {
        one.name: {kind: found.exported(Wanted((one,), remarks, calibration, cell)) for kind, found in kinds.items()}
        for one in both_directions(calibration, cell)
    }
