"""Interface of exporters, the data that they receive, and formatting of comments and quoted text.

Each module of an exporter in `exporters` defines `EXPORTER`, an `Exporter`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np

from basecal.cell import Calibration, Cell
from basecal.cell.results.versions import program_version
from basecal.errors import RefusedCalibration, printable
from basecal.fields.digits import two_digits
from basecal.geometry import PoseEstimate

ExportOption = Literal["transform", "robot", "camera", "urdf", "joint"]

_HASH_DIGITS = 12  # enough to distinguish recordings
_LINE_END = "\r\n"
_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True, eq=False)
class NamedTransform:
    """A transform with a position and a rotation.

    Attributes:
        name: Name of the transform, such as `eye_base_from_hand_base`.
        parent: Name of the first frame in other programs.
        child: Name of the second frame in other programs.
        estimate: `parent_from_child`.
        status: `fixed`, `prior` or `free`.
    """

    name: str
    parent: str
    child: str
    estimate: PoseEstimate
    status: str

    @property
    def own_frames(self) -> tuple[str, str]:
        """Names of parent and child in the cell."""
        parent, _, child = self.name.partition("_from_")
        return parent, child


@dataclass(frozen=True, eq=False)
class ExportRequest:
    """A request to an exporter, with the data that it writes.

    Attributes:
        transforms: The requested transforms.
        remarks: Lines of comments about the source of the calibration and doubts about it.
        calibration: The calibration.
        cell: The calibrated cell; None if unknown.
        folder: Folder of the cell; None if unknown.
        robot: Name of the requested robot; None if not requested.
        camera: Name of the requested camera; None if not requested.
        urdfs: URDFs to modify.
        joint: Name of the URDF joint to modify; None if it is unambiguous.
    """

    transforms: tuple[NamedTransform, ...]
    remarks: tuple[str, ...]
    calibration: Calibration
    cell: Cell | None = None
    folder: Path | None = None
    robot: str | None = None
    camera: str | None = None
    urdfs: tuple[Path, ...] = ()
    joint: str | None = None

    def may_have_controller(self, robot: str, kind: str) -> bool:
        """Whether a robot's controller is of a kind, or unknown."""
        known = None if self.cell is None else self.cell.robots.get(robot)
        return known is None or known.controller.get("format", kind) == kind


@dataclass(frozen=True)
class Exporter:
    """An export format of calibrations.

    Attributes:
        words: Description of the format for help.
        text: Function that returns the text of the file.
        options: Options of `basecal export` that select what it writes, the usual one first.
        is_pasted: Whether the text is meant to be pasted by a user: text of transforms.
    """

    words: str
    text: Callable[[ExportRequest], str]
    options: tuple[ExportOption, ...] = ("transform",)
    is_pasted: bool = False


def check_exportable(calibration: Calibration) -> None:
    """Check that a calibration is not refused.

    Raises:
        RefusedCalibration: if it is refused.
    """
    if calibration.verdict == "refused":
        raise RefusedCalibration(next((f.message for f in calibration.findings if f.severity == "error"), ""))


def provenance(calibration: Calibration, run: str | None = None) -> tuple[str, ...]:
    """Lines about the program, run and input files of a calibration, and about doubts if there are any.

    Args:
        calibration: The calibration.
        run: Name of the run, its UTC time; None if the calibration is not in a run.
    """
    run_text = "" if run is None else f", run {run}"
    hashes = [f"{name} {digest[: len('sha256:') + _HASH_DIGITS]}" for name, digest in calibration.inputs.items()]
    lines = [f"made by basecal {program_version()}{run_text}" + (f" from {', '.join(hashes)}" if hashes else "")]
    if calibration.verdict == "doubtful":
        codes = dict.fromkeys(f.code for f in calibration.findings if f.severity != "info")
        lines.append(f"DOUBTFUL: {', '.join(codes)}; see the report before it is used")
    return tuple(lines)


def describe_transform(transform: NamedTransform, units: str) -> str:
    """Description of a transform on one line: direction, units and sigma (3-D norms)."""
    parent, child = transform.own_frames
    estimate = transform.estimate
    mm, deg = 1e3 * float(np.linalg.norm(estimate.sigma_t)), np.degrees(np.linalg.norm(estimate.sigma_r))
    known = "fixed" if transform.status == "fixed" else f"1 sigma {two_digits(mm)} mm and {two_digits(deg)} deg"
    return f"{transform.name}: the pose of {child} in {parent}, {units}; {known}"


def comments(lines: Iterable[str], mark: str) -> list[str]:
    """Format lines as single-line comments that start with `mark`."""
    return [f"{mark} {' '.join(printable(line).split())}".strip() for line in lines]


def yaml_word(text: str) -> str:
    """Quote a text as a one-line ASCII string, valid in YAML 1.1 and 1.2."""
    return '"' + "".join(c if _is_plain(c) else f"\\U{ord(c):08x}" for c in text) + '"'


def _is_plain(character: str) -> bool:
    return character.isascii() and character.isprintable() and character not in '"\\'


def csv_row(cells: Iterable[str], numbers: Iterable[str] = ()) -> str:
    """Format a row of comma-separated values; text that spreadsheets would read as a formula gets the prefix `'`."""
    text = StringIO()
    texts = [f"'{cell}" if cell.startswith(_FORMULA_STARTS) else cell for cell in cells]
    csv.writer(text, lineterminator=_LINE_END).writerow([*texts, *numbers])  # quotes cells if necessary
    return text.getvalue().removesuffix(_LINE_END)


def xml_comment(text: str) -> Any:
    """Create an XML comment; consecutive hyphens are separated by spaces."""
    from xml.etree.ElementTree import Comment

    return Comment(f" {re.sub('-(?=-)', '- ', printable(text))} ")
