"""Import of parallel files of robot poses and of target poses or pixels as one recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import Literal, TypeVar

import numpy as np

from basecal.cell import (
    Cell,
    CellCamera,
    CellTarget,
    Observation,
    PixelObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
)
from basecal.errors import DatasetError, FrameNotFound, InputError, count_text
from basecal.exchange.columns import read_columns
from basecal.exchange.controller_poses import PoseStream, read_poses
from basecal.exchange.importing.imported import Imported, NoCell, Row, choose_name, known_cell
from basecal.exchange.importing.template import cell_text
from basecal.exchange.npz import read_arrays
from basecal.exchange.poses import LengthUnit
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import Array, IntArray

Item = TypeVar("Item")
Inverted = Literal["base-from-flange", "eye-base-from-flange", "hand-base-from-flange", "camera-from-target"]
_ALIASES = {"sample": ("samples",), "id": ("ids",), "u": ("u_px",), "v": ("v_px",)}
_LARGEST_INTEGER = 2.0**63
_EXPECTED = "expected sample, id, u, v (one row per point; in an archive also pixels, (n, 2), for u and v)"


@dataclass(frozen=True)
class Streams:
    """Files of an import, and the options to read them."""

    eye: str | None
    hand: str | None
    camera_from_target: str | None
    length_unit: LengthUnit
    invert: tuple[Inverted, ...] = ()
    pixels: str | None = None
    sigma_px: float | None = None

    @property
    def option_files(self) -> dict[Inverted, str | None]:
        """Files of poses by the name of their option."""
        return {
            "eye-base-from-flange": self.eye,
            "hand-base-from-flange": self.hand,
            "camera-from-target": self.camera_from_target,
        }

    @property
    def files(self) -> list[str]:
        """All files, as given by the user."""
        return [file for file in (*self.option_files.values(), self.pixels) if file is not None]


@dataclass(frozen=True)
class CellNames:
    """Names in the cell; a robot is None if the camera (`eye`) or the target (`hand`) is fixed to the world."""

    camera: str
    target: str
    eye: str | None
    hand: str | None


def read_streams(cell: str | Path, files: Streams, camera: str | None, target: str | None) -> Imported:
    """Read a recording from the files, with a new `cell.yaml` if the folder has none.

    Args:
        cell: Folder of the cell, or of a new cell.
        files: The files and their options.
        camera: Name of the camera; the cell's only camera if None.
        target: Name of the target; the cell's only target if None.

    Raises:
        InputError: if the files and the cell are inconsistent.
    """
    known = known_cell(cell)
    if isinstance(known, NoCell):
        names = _new_names(cell, files, camera, target)
    else:
        names = _known_names(known, files, camera, target)
    poses = _read(files)
    eye, hand = poses.get("eye-base-from-flange"), poses.get("hand-base-from-flange")
    carried = ((names.eye, eye), (names.hand, hand))
    recording = recording_from_streams(
        {robot: stream for robot, stream in carried if robot is not None and stream is not None},
        names.camera,
        names.target,
        poses.get("camera-from-target"),
        read_pixels(files.pixels) if files.pixels else None,
        files.sigma_px,
    )
    rows = tuple(Row(s.robots, s.observations, stamp_s=s.stamp_s) for s in recording.samples)
    text = None
    if isinstance(known, NoCell):
        text = cell_text(2 if files.eye and files.hand else 1, "pose", camera_on_world=not files.eye)
    inverted = f", inverted: {', '.join(files.invert)}" if files.invert else ""
    what = f"{count_text(len(rows), 'instant')} of {', '.join(poses)}, lengths in {files.length_unit}{inverted}"
    advice = "check --length-unit and --invert"
    return Imported(" and ".join(files.files), what, rows, new_cell=text, is_strict=False, advice=advice)


def _new_names(folder: str | Path, files: Streams, camera: str | None, target: str | None) -> CellNames:
    if files.pixels:
        make = f"basecal new {quote(str(folder))}"
        raise InputError(f"{folder} has no cell.yaml, which must describe the target and the lens: {make}")
    if not files.eye and not files.hand:
        raise InputError("no robot: give --eye-base-from-flange, --hand-base-from-flange or both")
    if camera not in (None, "camera") or target not in (None, "target"):
        raise InputError(f"{folder} has no cell.yaml to name {camera or target!r}: omit the names, or write it first")
    return CellNames("camera", "target", "eye" if files.eye else None, "hand" if files.hand else None)


def _known_names(cell: Cell, files: Streams, camera: str | None, target: str | None) -> CellNames:
    chosen_camera, chosen_target = _choose("camera", camera, cell.cameras), _choose("target", target, cell.targets)
    eye = _carrier(cell, chosen_camera, "--eye-base-from-flange", files.eye)
    hand = _carrier(cell, chosen_target, "--hand-base-from-flange", files.hand)
    if eye is not None and eye == hand:
        raise InputError(
            f"camera {chosen_camera.name!r} and target {chosen_target.name!r} are both on {eye!r}: views are useless"
        )
    return CellNames(chosen_camera.name, chosen_target.name, eye, hand)


def _choose(kind: str, name: str | None, items: Mapping[str, Item]) -> Item:
    chosen = choose_name(kind, name, items)
    if chosen not in items:
        raise FrameNotFound(chosen, list(items))
    return items[chosen]


def _carrier(cell: Cell, item: CellCamera | CellTarget, option: str, file: str | None) -> str | None:
    """Robot that carries a camera or target; None for the world. Checks that a file of its poses is given."""
    if item.on in cell.robots:
        if file is None:
            raise InputError(f"{item.name!r} is on robot {item.on!r} in cell.yaml: give its poses with {option}")
        return item.on
    if file is not None:
        raise InputError(f"{item.name!r} is on the world in cell.yaml, so {option} has no robot")
    return None


def _read(files: Streams) -> dict[Inverted, PoseStream]:
    given = {option: file for option, file in files.option_files.items() if file is not None}
    unmatched = [option for option in files.invert if option not in given]
    if unmatched:
        raise InputError(f"--invert {unmatched[0]}, but no file is given with --{unmatched[0]}")
    streams = {option: read_poses(file, files.length_unit) for option, file in given.items()}
    for option in files.invert:
        streams[option] = replace(streams[option], poses=streams[option].poses.inverse())
    return streams


def read_pixels(path: str | Path) -> dict[int, tuple[IntArray, Array]]:
    """Read ids (n,) and pixels (n, 2) [px] by sample, counted from 0, sorted by id.

    Args:
        path: A `.csv` with the columns sample, id, u, v, or a `.npz` with arrays of these names.

    Raises:
        DatasetError: if the content is invalid, or a sample has an id twice.
    """
    name = str(path)
    columns = _from_archive(name) if ".npz" in name.lower() else read_columns(name, _ALIASES).values
    missing = [key for key in ("sample", "id", "u", "v") if key not in columns]
    if missing:
        raise DatasetError(name, f"has no {', '.join(missing)} but {', '.join(columns) or 'nothing'}; {_EXPECTED}")
    samples, ids = _whole_numbers(name, columns, "sample"), _whole_numbers(name, columns, "id")
    pixels = np.stack([columns["u"], columns["v"]], -1)
    if np.any(far := np.abs(pixels).max(axis=-1) > LARGEST_VALUE):
        raise DatasetError(name, f"row {np.argmax(far)} is beyond {LARGEST_VALUE:g} px: correct it", field="u, v")
    order = np.lexsort((ids, samples))
    samples, ids, pixels = samples[order], ids[order], pixels[order]
    is_first = np.diff(samples, prepend=-1) != 0
    repeated = np.flatnonzero(~is_first & (np.diff(ids, prepend=-1) == 0))
    if len(repeated):
        raise DatasetError(name, f"sample {samples[repeated[0]]} has id {ids[repeated[0]]} twice")
    firsts = np.flatnonzero(is_first)
    parts = zip(np.split(ids, firsts)[1:], np.split(pixels, firsts)[1:], strict=True)
    return dict(zip(samples[firsts].tolist(), parts, strict=True))


def _whole_numbers(path: str, columns: Mapping[str, Array], key: str) -> IntArray:
    numbers = columns[key]
    wrong = np.flatnonzero((numbers != np.round(numbers)) | (numbers < 0) | (numbers >= _LARGEST_INTEGER))
    if len(wrong):
        raise DatasetError(path, f"row {wrong[0]} is {numbers[wrong[0]]:g}, expected a whole number from 0", field=key)
    return numbers.astype(np.int64)


def _from_archive(path: str) -> dict[str, Array]:
    known = {alias: name for name, others in _ALIASES.items() for alias in (name, *others)}
    name, arrays = read_arrays(path)
    columns = {known.get(key, key): value for key, value in arrays.items()}
    if "pixels" in columns:
        pixels = columns.pop("pixels")
        if pixels.ndim != 2 or pixels.shape[1] != 2:
            raise DatasetError(name, f"has shape {pixels.shape}, expected (n, 2)", field="pixels")
        columns["u"], columns["v"] = pixels.T
    for key, value in columns.items():
        if value.ndim != 1 or len(value) != len(next(iter(columns.values()))):
            raise DatasetError(name, f"has shape {value.shape}, expected one number for every point", field=key)
        if not np.isfinite(value).all():
            raise DatasetError(name, f"row {np.flatnonzero(~np.isfinite(value))[0]} is not finite", field=key)
    return columns


def recording_from_streams(
    robots: Mapping[str, PoseStream],
    camera: str,
    target: str,
    camera_from_target: PoseStream | None = None,
    pixels: Mapping[int, tuple[IntArray, Array]] | None = None,
    sigma_px: float | None = None,
) -> Recording:
    """Create a recording whose sample i has the i-th pose of every stream; a single pose means a robot at rest.

    Args:
        robots: `base_from_flange` by robot.
        camera: Name of the camera.
        target: Name of the target.
        camera_from_target: Poses of the target measured by another program, if there are any.
        pixels: Ids (n,) and pixels (n, 2) [px] by sample, if there are any; samples may be missing.
        sigma_px: Sigma of the pixels per coordinate [px]; None if not stated.

    Raises:
        InputError: if the streams differ in length, or pixels belong to a missing sample.
    """
    streams = [*robots.values(), *([camera_from_target] if camera_from_target else [])]
    lengths = {stream.path: len(stream.poses) for stream in streams}
    if not lengths:
        raise InputError("no pose file: at least one robot's poses are needed")
    count = max(lengths.values())
    moving = [stream for stream in streams if stream is camera_from_target or len(stream.poses) > 1]
    if any(len(stream.poses) != count for stream in moving):
        found = ", ".join(f"{path} holds {length}" for path, length in lengths.items())
        raise InputError(f"the pose files differ in length: {found}; pose i of each must belong to the same instant")
    unmatched = sorted(set(pixels or ()) - set(range(count)))
    if unmatched:
        raise InputError(f"pixels of sample {unmatched[0]}, but the poses end at sample {count - 1}")
    stamps = [stream.stamps_s for stream in streams if stream.stamps_s is not None and len(stream.poses) == count]
    stamps_s = next(iter(stamps), None)
    samples = []
    for i in range(count):
        observations: list[Observation] = []
        if camera_from_target:
            observations.append(PoseObservation(camera, target, camera_from_target.poses[i]))
        if pixels and i in pixels:
            ids, points = pixels[i]
            sigmas = None if sigma_px is None else np.full(len(ids), sigma_px)
            observations.append(PixelObservation(camera, target, ids, points, sigmas))
        states = {robot: RobotState(stream.poses[min(i, len(stream.poses) - 1)]) for robot, stream in robots.items()}
        stamp_s = None if stamps_s is None else float(stamps_s[i])
        samples.append(Sample(i, stamp_s, states, tuple(observations)))
    return Recording(tuple(samples))
