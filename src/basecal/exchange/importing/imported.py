"""Imported data in this project's terms: rows of a recording, and lines of a `cell.yaml`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from basecal.cell import Observation, RobotState
from basecal.fields.problems import Loc

By = Literal["order", "image", "sample", "stamp_s"]
"""What rows and samples are paired by."""


@dataclass(frozen=True)
class OneOf:
    """Annotation of an importer's parameter: what it is, and the names that it takes."""

    about: str
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Row:
    """Additions to one sample.

    Attributes:
        robots: Where robots were, by name.
        observations: What cameras saw.
        images: Files to be copied, by camera.
        image: Name of the image it belongs to; None if the file does not say.
        sample: Number of the sample it belongs to; likewise.
        stamp_s: Its time [s]; likewise.
        line: Its line in the file, from 1; None if the file has none.
    """

    robots: Mapping[str, RobotState] = field(default_factory=dict)
    observations: tuple[Observation, ...] = ()
    images: Mapping[str, Path] = field(default_factory=dict)
    image: str | None = None
    sample: int | None = None
    stamp_s: float | None = None
    line: int | None = None


@dataclass(frozen=True, eq=False)
class Imported:
    """Data that was read from one source.

    Attributes:
        source: The file or folder, as the user named it.
        what: What it holds, in which frames and units: "9 poses left_base_from_left_flange, ur: m, rotation vector".
        rows: For the recording, in the order of the source.
        cell: Plain data of a `cell.yaml` that is to be in it: new robots, cameras and targets, and what is known.
        replaced: Places of `cell.yaml` at which that stands in for what is written there.
        defaults: Places of it that are left as `cell.yaml` has them, unless recorded data is replaced.
        new_cell: All of a `cell.yaml` where there is none; `cell` makes one where None.
        files: Other files that the cell needs, such as a URDF, by their path in it.
        is_stream: Whether each row makes a line of its own, by the clock of what recorded it.
        by: What rows and samples are paired by; None for what both have.
        is_session: Whether its rows make samples of their own, as of another day.
        is_still: Whether its one row is of every sample, as of an arm that stands still.
        is_linked: Whether images become hard links instead of copies.
        advice: Which option to check if the input is implausible.
        is_strict: Whether implausible input is refused, and not only reported.
        notes: Lines about how it was read.
        warnings: Likewise, of what was left out.
        is_preview: Whether it holds notes alone, and nothing to bring into a cell.
        scratch: Folder that holds its images and other files, if they exist only as long as this object.
    """

    source: str
    what: str
    rows: tuple[Row, ...] = ()
    cell: Mapping[str, Any] = field(default_factory=dict)
    replaced: frozenset[Loc] = frozenset()
    defaults: frozenset[Loc] = frozenset()
    new_cell: str | None = None
    files: Mapping[str, Path] = field(default_factory=dict)
    is_stream: bool = False
    by: By | None = None
    is_session: bool = False
    is_still: bool = False
    is_linked: bool = False
    advice: str = "check the options"
    is_strict: bool = True
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    is_preview: bool = False
    scratch: TemporaryDirectory[str] | None = None


def controller_places(robots: Iterable[str]) -> frozenset[Loc]:
    """Places of `cell.yaml` that state which controllers wrote the poses of robots."""
    return frozenset(("robots", robot, "controller") for robot in robots)
