"""A line of `samples.jsonl`: one sample, validated against the cell."""

from __future__ import annotations

import codecs
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from basecal.cell.cell import Cell
from basecal.cell.journal.observation_line import UnknownPoint, observation, track_observation
from basecal.cell.journal.sample_values import FileLine, number, numbers, pose
from basecal.cell.recording import Observation, RobotState, Sample, TrackObservation
from basecal.errors import InputError
from basecal.fields.problems import CAUSE_LENGTH, shorten

_FIELDS = ("sample", "stamp_s", "robots", "images", "background", "observations")
_LARGEST_NUMBER = 2**53  # largest whole number in JSON that all programs read exactly
_LARGEST_STAMP = 1e12  # [s] absolute value: a double then still resolves 0.1 ms


@dataclass(frozen=True, eq=False)
class Context:
    """Context for the validation of a line.

    Attributes:
        cell: The cell.
        ids: Point ids of each target that has a shape.
        path_in_cell: Function from a path as written to a path relative to the cell; raises InputError.
    """

    cell: Cell
    ids: Mapping[str, frozenset[int]]
    path_in_cell: Callable[[str], str]


def make_context(cell: Cell, path_in_cell: Callable[[str], str]) -> Context:
    """Context for the validation of a cell's lines."""
    shapes = {name: entry.target for name, entry in cell.targets.items() if entry.target is not None}
    return Context(cell, {name: frozenset(shape.ids.tolist()) for name, shape in shapes.items()}, path_in_cell)


def line_data(text: bytes, file_line: FileLine) -> Any:
    """Parse a line.

    Raises:
        DatasetError: if the line is not JSON in UTF-8, is nested too deeply or has a duplicate key.
    """
    try:
        return _DECODER.decode(text.decode("utf-8"))
    except UnicodeDecodeError as error:
        is_utf_16 = text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        advice = ": it is UTF-16, save it as UTF-8" if is_utf_16 else "; expected one JSON object"
        raise file_line.error("", f"not UTF-8 text (byte {error.start} of the line){advice}") from None
    except json.JSONDecodeError as error:
        hint = "; remove the comma after the object" if text.rstrip().endswith(b"},") else ""
        what = f"not JSON ({error.msg}, column {error.colno}); expected one object a line"
        raise file_line.error("", f"{what}{hint}") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)[:CAUSE_LENGTH]
        if "int_max_str_digits" in reason:  # Python's message is for programmers
            reason = "a whole number has thousands of digits"
        raise file_line.error("", f"{reason}; expected one JSON object a line (docs/data_format.md)") from None


class DroppedSample(NamedTuple):
    """A sample that cannot be used, its line in the file, and the reason."""

    sample: int
    line: int
    reason: UnknownPoint


def sample_from_line(text: bytes, file_line: FileLine, context: Context) -> Sample | DroppedSample:
    """Read the sample of a line; if it is dropped, return the reason.

    Raises:
        DatasetError: if the line is invalid.
    """
    data = line_data(text, file_line)
    try:
        # No field of a line is boolean, and NumPy would convert true and false to 1 and 0.
        if (b"true" in text or b"false" in text) and (field := _first_boolean(data, "")) is not None:
            raise file_line.error(field, "expected a number or text, got true or false")
        data = file_line.mapping(data, "", _FIELDS)
        index = data.get("sample")
        if not isinstance(index, int) or not 0 <= index < _LARGEST_NUMBER:
            raise file_line.error("sample", f"expected the sample's number, 0 or more, got {shorten(index)}")
        stamp = number(file_line, "stamp_s", data["stamp_s"], _LARGEST_STAMP) if "stamp_s" in data else None
        robots = file_line.mapping(data.get("robots", {}), "robots")
        states = {
            name: _state(value, f"robots.{name}", name, file_line, context.cell) for name, value in robots.items()
        }
        images, background = (_paths(data.get(key, {}), key, file_line, context) for key in ("images", "background"))
        try:
            observations, tracks = _observations(data.get("observations", []), file_line, context)
        except UnknownPoint as error:
            return DroppedSample(index, file_line.line, error)
        return Sample(index, stamp, states, observations, images, background, tracks)
    except RecursionError:
        raise file_line.error("", "nested too deeply; expected one JSON object a line") from None


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) != len(pairs):
        keys = [key for key, _ in pairs]
        repeated = next(key for index, key in enumerate(keys) if key in keys[:index])
        raise InputError(f"the key {shorten(repeated)} is given twice")
    return data


_DECODER = json.JSONDecoder(object_pairs_hook=_unique_keys)


def _first_boolean(value: Any, field: str) -> str | None:
    """Field of the first boolean in a value; None if there is none."""
    if isinstance(value, bool):
        return field
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    fields = (_first_boolean(item, f"{field}.{key}".removeprefix(".")) for key, item in items)
    return next((each for each in fields if each is not None), None)


def _state(value: Any, field: str, name: str, file_line: FileLine, cell: Cell) -> RobotState:
    robot = cell.robots[file_line.name(name, field, "robot", cell.robots)]
    state = file_line.mapping(value, field, ("base_from_flange", "joints_rad"))
    if len(state) != 1:
        got = "both" if state else "neither"
        raise file_line.error(field, f"expected either base_from_flange or joints_rad, got {got}")
    if "base_from_flange" in state:
        return RobotState(base_from_flange=pose(file_line, f"{field}.base_from_flange", state["base_from_flange"])[0])
    joints = numbers(file_line, f"{field}.joints_rad", state["joints_rad"])
    if robot.chain is None:
        raise file_line.error(
            f"{field}.joints_rad", "joints need urdf, base_link and flange_link of the robot in cell.yaml"
        )
    if len(joints) != robot.chain.n:
        raise file_line.error(f"{field}.joints_rad", f"expected {robot.chain.n} joints, got {len(joints)}")
    return RobotState(joints_rad=joints)


def _paths(value: Any, field: str, file_line: FileLine, context: Context) -> dict[str, str]:
    paths = {}
    for camera, path in file_line.mapping(value, field).items():
        file_line.name(camera, f"{field}.{camera}", "camera", context.cell.cameras)
        if not isinstance(path, str):
            raise file_line.error(f"{field}.{camera}", f"expected a path, got {shorten(path)}")
        try:
            paths[camera] = context.path_in_cell(path)
        except InputError as error:
            raise file_line.error(f"{field}.{camera}", str(error)) from None
    return paths


def _observations(
    value: Any, file_line: FileLine, context: Context
) -> tuple[tuple[Observation, ...], tuple[TrackObservation, ...]]:
    if not isinstance(value, list):
        raise file_line.error("observations", f"expected a list, got {shorten(value)}")
    observations: dict[tuple[str, str], Observation | None] = {}
    tracks: dict[str, TrackObservation] = {}
    for index, item in enumerate(value):
        field = f"observations[{index}]"
        if isinstance(item, dict) and "tracks" in item:
            track = track_observation(item, field, file_line, context.cell)
            if track.camera in tracks:
                raise file_line.error(field, f"{track.camera!r} has tracks twice in one sample; join them")
            tracks[track.camera] = track
            continue
        (camera, target), read = observation(item, field, file_line, context.cell, context.ids)
        if (camera, target) in observations:
            raise file_line.error(
                field, f"{camera!r} sees {target!r} twice in one sample; join them or give two samples"
            )
        observations[camera, target] = read
    return tuple(read for read in observations.values() if read is not None), tuple(tracks.values())
