"""The face of an exporter, how one is found, and what it gives of a calibration."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, Literal, Protocol

from basecal.cell import Calibration, Cell
from basecal.errors import FrameNotFound, RefusedCalibration
from basecal.exchange.exports.choice import both_directions, chosen_transforms
from basecal.exchange.exports.remarks import provenance
from basecal.exchange.exports.wanted import Wanted
from basecal.registry import EXPORTERS

Of = Literal["transform", "robot", "camera"]


class Exporter(Protocol):
    """What a module of this folder has.

    Attributes:
        OF: What of a calibration it writes; that is an option of `basecal export`.
        PASTED: Whether people paste it: of transforms, and text.
    """

    OF: Of
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
    of: str | None = None,
    *,
    cell: Cell | None = None,
    folder: Path | None = None,
    run: str | None = None,
) -> str:
    """A calibration as the text of another program's file.

    Args:
        calibration: What came out.
        kind: For which program, one of `basecal.registry.EXPORTERS`.
        of: Name of a transform, in whichever direction, or of the robot or camera where the kind takes that; what the
            cell was calibrated for where None.
        cell: What was calibrated: it names frames, and some kinds need it.
        folder: Where the cell's files are.
        run: Name of the calibration's run, said in comments.

    Raises:
        FrameNotFound: if there is no such kind, transform, robot or camera.
        RefusedCalibration: if the calibration is refused.
        InputError: if what is asked for cannot be exported.
    """
    if kind not in EXPORTERS:
        raise FrameNotFound(kind, list(EXPORTERS))
    if calibration.verdict == "refused":
        raise RefusedCalibration(next((f.message for f in calibration.findings if f.severity == "error"), ""))
    found = exporter(kind)
    transforms = chosen_transforms(calibration, cell, of) if found.OF == "transform" else ()
    return found.exported(Wanted(transforms, provenance(calibration, run), calibration, cell, folder, of))


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
