"""Data structures of imports: rows, entries of `cell.yaml`, and the choice of names and carriers in a cell."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, Observation, PoseObservation, Robot, RobotState, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.errors import InputError, list_names, spelling_hint
from basecal.fields.problems import Loc
from basecal.geometry import SE3

PairingMethod = Literal["order", "image", "sample", "stamp_s"]
"""Method of pairing rows with samples."""


@dataclass(frozen=True)
class OneOf:
    """Annotation of an importer's parameter: its description and its allowed names."""

    description: str
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Row:
    """Additions to one sample.

    Attributes:
        robots: States of robots by name.
        observations: Observations of cameras.
        images: Image files to be copied, by camera.
        image: Name of the image to which the row belongs; None if not stated.
        sample: Number of the sample to which the row belongs; None if not stated.
        stamp_s: Time stamp [s]; None if not stated.
        line: Line in the file, from 1; None if the file has no lines.
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
    """Data read from one source.

    Attributes:
        source: The file or folder, as named by the user.
        what: Content with frames and units, such as "9 poses left_base_from_left_flange, ur: m, rotation vector".
        rows: Rows for the recording, in the order of the source.
        cell: Plain data to add to `cell.yaml`: new robots, cameras and targets, and prior knowledge.
        replaced: Locations of `cell.yaml` at which `cell` replaces existing values.
        defaults: Locations at which existing values of `cell.yaml` are kept, unless recorded data are replaced.
        new_cell: Text of a new `cell.yaml` if there is none; if None, it is created from `cell`.
        files: Other files that the cell needs, such as a URDF, by their path in the cell.
        is_stream: Whether each row becomes a separate line, with the clock of its device.
        by: Method of pairing rows with samples; None to choose it from the available keys.
        is_session: Whether the rows become new samples, such as those of another day.
        is_still: Whether the single row belongs to every sample, as for an arm at rest.
        is_linked: Whether images become hard links instead of copies.
        advice: Which option to check if the input is implausible.
        is_strict: Whether implausible input is rejected instead of only reported.
        notes: Lines about how the source was read.
        warnings: Lines about data that were left out.
        is_preview: Whether there are only notes and nothing to import.
        scratch: Temporary folder of images and other files; it exists as long as this object.
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
    by: PairingMethod | None = None
    is_session: bool = False
    is_still: bool = False
    is_linked: bool = False
    advice: str = "check the options"
    is_strict: bool = True
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    is_preview: bool = False
    scratch: TemporaryDirectory[str] | None = None


def controller_locations(robots: Iterable[str]) -> frozenset[Loc]:
    """Locations of `cell.yaml` for the controllers of robots."""
    return frozenset(("robots", robot, "controller") for robot in robots)


@dataclass(frozen=True)
class NoCell:
    """Empty cell of a folder without a `cell.yaml`."""

    robots: Mapping[str, Robot] = field(default_factory=dict)
    cameras: Mapping[str, CellCamera] = field(default_factory=dict)
    targets: Mapping[str, CellTarget] = field(default_factory=dict)


KnownCell = Cell | NoCell

NO_CELL = NoCell()


def known_cell(folder: str | Path) -> KnownCell:
    """Read the cell of a folder; `NO_CELL` if there is none.

    Raises:
        DatasetError: if the cell cannot be read.
    """
    return read_cell(folder) if (Path(folder) / "cell.yaml").exists() else NO_CELL


def recorded_samples(folder: str | Path, cell: KnownCell) -> tuple[Sample, ...]:
    """Read the recorded samples of a cell; empty if there is no cell or no recording.

    Raises:
        DatasetError: if the recording cannot be read.
    """
    if isinstance(cell, NoCell) or not (Path(folder) / "recording" / "samples.jsonl").exists():
        return ()
    return read_recording(folder, cell).samples


def replaceable_size(folder: str | Path, cell: KnownCell, camera: str) -> frozenset[Loc]:
    """Location of a known camera's size, if its first images may change it; empty if a lens or views depend on it."""
    intrinsics = cell.cameras[camera].intrinsics
    has_lens = intrinsics is not None and intrinsics.camera is not None
    samples = recorded_samples(folder, cell)
    is_recorded = any(camera in s.images or any(o.camera == camera for o in s.observations) for s in samples)
    return frozenset() if has_lens or is_recorded else frozenset({("cameras", camera, "size_px")})


def choose_name(kind: str, name: str | None, names: Collection[str], default: str = "") -> str:
    """Choose a name: the given one, else the only one in the cell, else the default.

    Args:
        kind: `camera`, `target` or `robot`.
        name: The given name; None if not given.
        names: Names in the cell.
        default: Default name of a new item; empty if the item must exist.

    Raises:
        InputError: if no name is given and the cell has several, or has none and there is no default.
    """
    if name is None and (len(names) > 1 or not (names or default)):
        known = list_names(list(names)) if names else f"none in this cell: add a {kind} first"
        raise InputError(f"which {kind}? --{kind} is one of: {known}")
    return name or next(iter(names), default)


def choose_carrier(
    cell: KnownCell, kind: str, name: str, stated_carrier: str | None, option: str = "--on", may_be_world: bool = True
) -> str:
    """Choose the carrier of a camera or target: from the cell, as stated, else the cell's only robot.

    Args:
        cell: The cell, if there is one.
        kind: `camera` or `target`.
        name: Name of the camera or target.
        stated_carrier: Carrier stated by the user: a robot, or `world`; None if not stated.
        option: The option that states the carrier.
        may_be_world: Whether `world` is allowed in a cell without robots.

    Raises:
        InputError: if the carrier is ambiguous, or contradicts the cell.
    """
    robots = [*cell.robots]
    things: Mapping[str, CellCamera | CellTarget] = cell.cameras if kind == "camera" else cell.targets
    known = things[name].on if name in things else stated_carrier
    if stated_carrier not in (None, known):
        found = f"{kind} {name!r} is on {known!r} in cell.yaml, not on {stated_carrier!r}"
        raise InputError(f"{found}: omit {option}, or correct it")
    if not robots and known == WORLD and not may_be_world:
        raise InputError(f"{kind} {name!r} on the world needs a robot, and there is no cell.yaml: import poses first")
    if known is None and len(robots) != 1:
        choices = list_names([*robots, WORLD]) if robots else f"a robot{f' or {WORLD}' if may_be_world else ''}"
        raise InputError(f"{kind} {name!r} is new: give its carrier with {option}, one of: {choices}")
    return known or robots[0]


def check_robot(cell: KnownCell, carrier: str) -> None:
    """Check that the name of a new carrier is not a misspelling of a name in the cell.

    Raises:
        InputError: if the name is similar to one in the cell.
    """
    robots = [*cell.robots]
    if carrier not in (WORLD, *robots) and (close := spelling_hint(carrier, [*robots, WORLD])):
        raise InputError(f"no robot {carrier!r}{close}; there are: {list_names(robots)}")


def carried_entry(section: str, name: str, carrier: str, **fields: Any) -> dict[str, Any]:
    """Entries of `cell.yaml` for a new camera or target, and for the robot that carries it."""
    entry = {section: {name: {"on": carrier, **fields}}}
    return entry if carrier == WORLD else {"robots": {carrier: {}}, **entry}


@dataclass(frozen=True)
class ViewNames:
    """Names of a camera and its target, and their carriers if stated by the user."""

    camera: str
    target: str
    camera_on: str | None = None
    target_on: str | None = None


def add_target_poses(rows: tuple[Row, ...], camera_from_target: SE3, names: ViewNames) -> tuple[Row, ...]:
    """Add observed target poses to rows.

    Args:
        rows: n rows with the keys that assign them to samples.
        camera_from_target: (n,) poses of the target.
        names: Names of camera and target.
    """
    views = (PoseObservation(names.camera, names.target, camera_from_target[i]) for i in range(len(rows)))
    return tuple(replace(row, observations=(view,)) for row, view in zip(rows, views, strict=True))


def view_entry(cell: KnownCell, names: ViewNames) -> dict[str, Any]:
    """Entries of `cell.yaml` for a camera and a target; existing entries are not changed.

    By default, a new camera is on the only robot. A new target is on the world, or on the only robot if the camera is
    on the world.

    Raises:
        InputError: if a carrier is ambiguous or contradicts the cell, or both have the same carrier.
    """
    camera_on = choose_carrier(cell, "camera", names.camera, names.camera_on)
    stated = names.target_on
    if stated is None and camera_on != WORLD and names.target not in cell.targets:
        stated = WORLD
    target_on = choose_carrier(cell, "target", names.target, stated, "--target-on")
    if camera_on == target_on:
        raise InputError(f"camera {names.camera!r} and target {names.target!r} are both on {camera_on!r}")
    camera, target = (
        carried_entry("cameras", names.camera, camera_on),
        carried_entry("targets", names.target, target_on),
    )
    return {
        "robots": {**camera.get("robots", {}), **target.get("robots", {})},
        "cameras": {names.camera: {}} if names.camera in cell.cameras else camera["cameras"],
        "targets": {names.target: {}} if names.target in cell.targets else target["targets"],
    }
