"""Imported data in this project's terms: rows, lines of a `cell.yaml`, and the cell and the things they are for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, Observation, PoseObservation, Robot, RobotState, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.errors import InputError, list_names, nearest
from basecal.fields.problems import Loc
from basecal.geometry import SE3

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


@dataclass(frozen=True)
class NoCell:
    """The content of a folder without a `cell.yaml`: nothing."""

    robots: Mapping[str, Robot] = field(default_factory=dict)
    cameras: Mapping[str, CellCamera] = field(default_factory=dict)
    targets: Mapping[str, CellTarget] = field(default_factory=dict)


KnownCell = Cell | NoCell

NO_CELL = NoCell()


def known_cell(folder: str | Path) -> KnownCell:
    """The cell of a folder, or that there is none yet.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_cell(folder) if (Path(folder) / "cell.yaml").exists() else NO_CELL


def recorded_samples(folder: str | Path, cell: KnownCell) -> tuple[Sample, ...]:
    """The samples that are recorded in the folder of a cell; none if there is no cell.

    Raises:
        DatasetError: if they cannot be read.
    """
    if isinstance(cell, NoCell) or not (Path(folder) / "recording" / "samples.jsonl").exists():
        return ()
    return read_recording(folder, cell).samples


def open_size(folder: str | Path, cell: KnownCell, camera: str) -> frozenset[Loc]:
    """The place of a known camera's size, if nothing rests on it: its first images may state another."""
    known = cell.cameras[camera]
    has_numbers = known.intrinsics is not None and known.intrinsics.camera is not None
    samples = recorded_samples(folder, cell)
    is_recorded = any(camera in s.images or any(o.camera == camera for o in s.observations) for s in samples)
    return frozenset() if has_numbers or is_recorded else frozenset({("cameras", camera, "size_px")})


def choose_name(kind: str, name: str | None, names: Collection[str], usual: str = "") -> str:
    """The name that was given, else the only one that the cell has, else the usual one.

    Args:
        kind: `camera`, `target` or `robot`.
        name: As given.
        names: Those of the cell.
        usual: That of a new one; empty if it must be there.

    Raises:
        InputError: if none is given and the cell has several, or none where one must be.
    """
    if name is None and (len(names) > 1 or not (names or usual)):
        known = list_names(list(names)) if names else f"none in this cell: add a {kind} first"
        raise InputError(f"which {kind}? --{kind} is one of: {known}")
    return name or next(iter(names), usual)


def choose_carrier(
    cell: KnownCell, kind: str, name: str, stated_carrier: str | None, option: str = "--on", may_be_world: bool = True
) -> str:
    """The carrier of a camera or target: as the cell has it, as stated, else its only robot.

    Args:
        cell: The cell there is, if any.
        kind: `camera` or `target`.
        name: Of the camera or target.
        stated_carrier: As stated: a robot, or `world`.
        option: The option that states it.
        may_be_world: Whether a new cell without a robot may result.

    Raises:
        InputError: if it is not clear, or the cell says otherwise.
    """
    robots = [*cell.robots]
    things: Mapping[str, CellCamera | CellTarget] = cell.cameras if kind == "camera" else cell.targets
    known = things[name].on if name in things else stated_carrier
    if stated_carrier not in (None, known):
        found = f"{kind} {name!r} is on {known!r} in cell.yaml, not on {stated_carrier!r}"
        raise InputError(f"{found}: leave {option} away, or correct it")
    if not robots and known == WORLD and not may_be_world:
        raise InputError(f"{kind} {name!r} on the world needs a robot, and there is no cell.yaml: import poses first")
    if known is None and len(robots) != 1:
        choices = list_names([*robots, WORLD]) if robots else f"a robot{f' or {WORLD}' if may_be_world else ''}"
        raise InputError(f"{kind} {name!r} is new: say what carries it, {option} with one of: {choices}")
    return known or robots[0]


def check_robot(cell: KnownCell, carrier: str) -> None:
    """Check that a carrier, if it is new, is not named nearly as one that the cell has.

    Raises:
        InputError: if it is.
    """
    robots = [*cell.robots]
    if carrier not in (WORLD, *robots) and (close := nearest(carrier, [*robots, WORLD])):
        raise InputError(f"no robot {carrier!r}{close}; there are: {list_names(robots)}")


def carried_entry(section: str, name: str, carrier: str, **fields: Any) -> dict[str, Any]:
    """Sections of `cell.yaml` for a new camera or target, whose mount is free, with the robot that carries it."""
    entry = {section: {name: {"on": carrier, **fields}}}
    return entry if carrier == WORLD else {"robots": {carrier: {}}, **entry}


@dataclass(frozen=True)
class Sight:
    """Which camera sees which target, and what carries them where the cell does not say."""

    camera: str
    target: str
    camera_on: str | None = None
    target_on: str | None = None


def seen_rows(rows: tuple[Row, ...], camera_from_target: SE3, sight: Sight) -> tuple[Row, ...]:
    """Rows with what the camera saw.

    Args:
        rows: What says where each belongs.
        camera_from_target: (n,) poses.
        sight: Names.
    """
    views = (PoseObservation(sight.camera, sight.target, camera_from_target[i]) for i in range(len(rows)))
    return tuple(replace(row, observations=(view,)) for row, view in zip(rows, views, strict=True))


def sight_entry(cell: KnownCell, sight: Sight) -> dict[str, Any]:
    """Entries of `cell.yaml` for a camera and a target; those it has already stay.

    A new camera is on the only robot. A new target is on the world, or on the only robot where the camera is not.

    Raises:
        InputError: if it is not clear what carries them, both are on one thing, or the cell says otherwise.
    """
    camera_on = choose_carrier(cell, "camera", sight.camera, sight.camera_on)
    given = sight.target_on
    if given is None and camera_on != WORLD and sight.target not in cell.targets:
        given = WORLD
    target_on = choose_carrier(cell, "target", sight.target, given, "--target-on")
    if camera_on == target_on:
        raise InputError(f"camera {sight.camera!r} and target {sight.target!r} are both on {camera_on!r}")
    camera, target = (
        carried_entry("cameras", sight.camera, camera_on),
        carried_entry("targets", sight.target, target_on),
    )
    return {
        "robots": {**camera.get("robots", {}), **target.get("robots", {})},
        "cameras": {sight.camera: {}} if sight.camera in cell.cameras else camera["cameras"],
        "targets": {sight.target: {}} if sight.target in cell.targets else target["targets"],
    }
