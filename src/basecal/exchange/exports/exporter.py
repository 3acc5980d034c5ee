"""The class of an exporter, the request that it answers, and comments and quoted words of its file.

Its module in `exporters` ends in an `EXPORTER` of this class.
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
from basecal.geometry import PoseEstimate

Takes = Literal["transform", "robot", "camera", "urdf", "joint"]

_HASH = 12  # digits of a hash: enough to tell any two recordings apart
_ENDS = "\r\n"
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True, eq=False)
class NamedTransform:
    """A transform that has both a place and a rotation.

    Attributes:
        name: Such as `eye_base_from_hand_base`.
        parent: What its first frame is called in other programs.
        child: Likewise its second.
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
        """Its frames as the cell calls them."""
        parent, _, child = self.name.partition("_from_")
        return parent, child


@dataclass(frozen=True, eq=False)
class Wanted:
    """The content that an exporter may write.

    Attributes:
        transforms: The requested ones.
        remarks: What they were made from and whether that is doubtful, a line each, for comments.
        calibration: Where they come from.
        cell: What was calibrated; None if it is not known.
        folder: Where the cell's files are; None likewise.
        robot: The robot requested; None if none was.
        camera: Likewise the camera.
        urdfs: URDFs to build on.
        joint: The joint of one that is meant; None if it is clear.
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
        """Whether a robot's controller may be of a kind: it is not known to be of another."""
        known = None if self.cell is None else self.cell.robots.get(robot)
        return known is None or known.controller.get("format", kind) == kind


@dataclass(frozen=True)
class Exporter:
    """A calibration as the text of another program's file.

    Attributes:
        words: What it gives, for help.
        text: Writes the file.
        takes: What of a calibration it can write, what is usual first; each is an option of `basecal export`.
        is_pasted: Whether people paste it: of transforms, and text.
    """

    words: str
    text: Callable[[Wanted], str]
    takes: tuple[Takes, ...] = ("transform",)
    is_pasted: bool = False


def check_exportable(calibration: Calibration) -> None:
    """Check that a calibration is not refused.

    Raises:
        RefusedCalibration: if it is.
    """
    if calibration.verdict == "refused":
        raise RefusedCalibration(next((f.message for f in calibration.findings if f.severity == "error"), ""))


def provenance(calibration: Calibration, run: str | None = None) -> tuple[str, ...]:
    """Source of a calibration, a line each, then the doubts about it if there are any.

    Args:
        calibration: What came out.
        run: Name of its run, which is the UTC time of it; None if it is in no run.
    """
    of = "" if run is None else f", run {run}"
    hashes = [f"{name} {digest[: len('sha256:') + _HASH]}" for name, digest in calibration.inputs.items()]
    lines = [f"made by basecal {program_version()}{of}" + (f" from {', '.join(hashes)}" if hashes else "")]
    if calibration.verdict == "doubtful":
        codes = dict.fromkeys(f.code for f in calibration.findings if f.severity != "info")
        lines.append(f"DOUBTFUL: {', '.join(codes)}; see the report before it is used")
    return tuple(lines)


def describe_transform(transform: NamedTransform, units: str) -> str:
    """Description of a transform in a line: its direction, its units, and its sigma."""
    parent, child = transform.own_frames
    estimate = transform.estimate
    mm, deg = np.linalg.norm(estimate.sigma_t) * 1e3, np.degrees(np.linalg.norm(estimate.sigma_r))
    known = "fixed" if transform.status == "fixed" else f"1 sigma {mm:.2g} mm and {deg:.2g} deg"
    return f"{transform.name}: the pose of {child} in {parent}, {units}; {known}"


def comments(lines: Iterable[str], mark: str) -> list[str]:
    """Lines of comments that hold nothing but one line each; `mark` begins each, if it is not empty."""
    return [f"{mark} {' '.join(printable(line).split())}".strip() for line in lines]


def yaml_word(text: str) -> str:
    """A string of YAML, of both its versions, on one line and in ASCII."""
    return '"' + "".join(c if _is_plain(c) else f"\\U{ord(c):08x}" for c in text) + '"'


def _is_plain(character: str) -> bool:
    return character.isascii() and character.isprintable() and character not in '"\\'


def csv_row(cells: Iterable[str], numbers: Iterable[str] = ()) -> str:
    """A row of comma-separated values; a text that a table would calculate as a formula starts with `'`."""
    text = StringIO()
    texts = [f"'{cell}" if cell.startswith(_FORMULA) else cell for cell in cells]
    csv.writer(text, lineterminator=_ENDS).writerow([*texts, *numbers])  # quotes what holds any of them
    return text.getvalue().removesuffix(_ENDS)


def xml_comment(text: str) -> Any:
    """An element of XML that is a comment, and holds no two hyphens in a row."""
    from xml.etree.ElementTree import Comment

    return Comment(f" {re.sub('-(?=-)', '- ', printable(text))} ")
