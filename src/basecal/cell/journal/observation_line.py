"""Observations in `samples.jsonl`: pixels, candidates, poses, 3-D points, touches, or tracks of the static scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell.cell import Cell, grip_name
from basecal.cell.journal.sample_values import FileLine, numbers, pose, sigmas, whole_numbers
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    TouchObservation,
    TrackObservation,
)
from basecal.errors import InputError, count_text
from basecal.geometry import Array, IntArray

_CAMERA_AND_TARGET = ("camera", "target")
_FIELDS = {
    "pixels": (*_CAMERA_AND_TARGET, "ids", "pixels", "sigma_px"),
    "candidates": (*_CAMERA_AND_TARGET, "candidates", "sigma_px"),
    "camera_from_target": (*_CAMERA_AND_TARGET, "camera_from_target"),
    "points_in_camera_m": (*_CAMERA_AND_TARGET, "ids", "points_in_camera_m", "sigma_m"),
}
_TOUCH_FIELDS = ("tip", "touch", "tip2", "sigma_m")
_CLAMP_FIELDS = ("clamp", "sigma_m", "sigma_rad")
_TRACK_FIELDS = ("camera", "tracks", "pixels")
_ANY_FIELDS = tuple(dict.fromkeys(field for fields in _FIELDS.values() for field in fields))


def track_observation(data: dict[str, Any], field: str, file_line: FileLine, cell: Cell) -> TrackObservation:
    """Read a camera's observation of the static scene.

    Raises:
        DatasetError: if the observation is invalid.
    """
    file_line.mapping(data, field, _TRACK_FIELDS)
    camera = file_line.name(data.get("camera"), f"{field}.camera", "camera", cell.cameras)
    if cell.cameras[camera].intrinsics is None:
        raise file_line.error(f"{field}.camera", f"pixels of {camera!r} need its size_px and intrinsics in cell.yaml")
    tracks = whole_numbers(file_line, f"{field}.tracks", data["tracks"])
    pixels = numbers(file_line, f"{field}.pixels", data.get("pixels"), 2)
    if len(tracks) != len(pixels):
        raise file_line.error(
            f"{field}.tracks",
            f"{count_text(len(tracks), 'track')} for {count_text(len(pixels), 'pixel')}; expected one each",
        )
    if len(np.unique(tracks)) != len(tracks):
        raise file_line.error(f"{field}.tracks", "a track is given twice in one image")
    return TrackObservation(camera, tracks, pixels)


class UnknownPoint(InputError):
    """An observation of a point that is not on the target, or of one point twice.

    Attributes:
        target: Name of the target.
        ids: Ids of the observed points.
        known: Ids of the target's points.
    """

    def __init__(self, message: str, target: str, ids: frozenset[int], known_ids: frozenset[int]) -> None:
        super().__init__(message)
        self.target, self.ids, self.known = target, ids, known_ids


def observation(
    value: Any, field: str, file_line: FileLine, cell: Cell, ids: Mapping[str, frozenset[int]]
) -> tuple[tuple[str, str], Observation | None]:
    """Read an observation: names of camera and target, and the observation, None if it is empty.

    Raises:
        DatasetError: if the observation is invalid.
        UnknownPoint: if an id is not on the target, or given twice.
    """
    data = file_line.mapping(value, field, (*_ANY_FIELDS, *_TOUCH_FIELDS, *_CLAMP_FIELDS))
    if "tip" in data or "clamp" in data:
        touch = (_touch if "tip" in data else _grip)(data, field, file_line, cell)
        return (touch.tip, touch.mark), touch
    kinds = [kind for kind in _FIELDS if kind in data]
    if len(kinds) != 1:
        expected = f"expected exactly one of {', '.join(_FIELDS)}, tip with touch or tip2, or clamp"
        raise file_line.error(field, f"{expected}, got {' and '.join(kinds) or 'none'}")
    kind = kinds[0]
    file_line.mapping(data, field, _FIELDS[kind])
    camera = file_line.name(data.get("camera"), f"{field}.camera", "camera", cell.cameras)
    target = file_line.name(data.get("target"), f"{field}.target", "target", cell.targets)
    shape = cell.targets[target].target
    if kind == "camera_from_target":
        if shape is not None and shape.is_point:
            raise file_line.error(
                f"{field}.camera_from_target",
                f"{target!r} is one point, which has no orientation. Leave out its `kind` in cell.yaml and state its "
                "mount with a rotation. Views of the point itself are of another target",
            )
        mean, sigma = pose(file_line, f"{field}.camera_from_target", data[kind], with_sigmas=True)
        return (camera, target), PoseObservation(camera, target, mean, sigma)
    if shape is None:
        raise file_line.error(f"{field}.target", f"points of {target!r} need its `kind` and shape in cell.yaml")
    if kind == "candidates" and not shape.is_point:
        raise file_line.error(f"{field}.candidates", f"candidates are for a single LED; {target!r} has several points")
    if kind != "points_in_camera_m" and cell.cameras[camera].intrinsics is None:
        raise file_line.error(f"{field}.camera", f"pixels of {camera!r} need its size_px and intrinsics in cell.yaml")
    return (camera, target), _points(kind, data, field, file_line, ids[target])


def _touch(data: dict[str, Any], field: str, file_line: FileLine, cell: Cell) -> TouchObservation:
    """Read a touch of a tip at a mark or at another tip."""
    file_line.mapping(data, field, _TOUCH_FIELDS)
    given = [key for key in ("touch", "tip2") if key in data]
    if len(given) != 1:
        raise file_line.error(field, f"expected tip with touch or tip2, got {' and '.join(given) or 'neither'}")
    tips = [name for name, camera in cell.cameras.items() if camera.kind == "tip"]
    marks = [name for name, target in cell.targets.items() if target.is_touched and target.on not in cell.robots]
    tip = file_line.name(data["tip"], f"{field}.tip", "tip", tips)
    kind, names = ("mark", marks) if "touch" in data else ("tip", tips)
    mark = file_line.name(data[given[0]], f"{field}.{given[0]}", kind, names)
    if cell.targets[mark].on == cell.cameras[tip].on:
        raise file_line.error(f"{field}.tip2", f"{tip!r} and {mark!r} are on one robot: no pose brings them together")
    return TouchObservation(tip, mark, _sigma(data, field, file_line, "sigma_m"), "tip2" if "tip2" in data else "touch")


def _grip(data: dict[str, Any], field: str, file_line: FileLine, cell: Cell) -> TouchObservation:
    """Read an observation of a part held by two robots."""
    file_line.mapping(data, field, _CLAMP_FIELDS)
    clamps = [name for name, camera in cell.cameras.items() if camera.kind == "clamp"]
    name = file_line.name(data["clamp"], f"{field}.clamp", "clamp", clamps)
    sigma_m, sigma_rad = (_sigma(data, field, file_line, key) for key in ("sigma_m", "sigma_rad"))
    return TouchObservation(name, grip_name(name), sigma_m, "clamp", sigma_rad)


def _sigma(data: dict[str, Any], field: str, file_line: FileLine, key: str) -> float | None:
    sigma = sigmas(file_line, f"{field}.{key}", data.get(key), 1)
    return None if sigma is None else float(sigma[0])


def _points(
    kind: str, data: dict[str, Any], field: str, file_line: FileLine, known_ids: frozenset[int]
) -> PixelObservation | CandidateObservation | PointObservation | None:
    """Read observed points, in pixels or in the camera's frame; None if there are none."""
    in_space = kind == "points_in_camera_m"
    points = numbers(file_line, f"{field}.{kind}", data[kind], 3 if in_space else 2)
    ids = None if kind == "candidates" else _ids(data, field, file_line, known_ids, points)
    sigma_field = "sigma_m" if in_space else "sigma_px"
    sigma = sigmas(file_line, f"{field}.{sigma_field}", data.get(sigma_field), len(points))
    if not len(points):
        return None
    if ids is None:
        return CandidateObservation(data["camera"], data["target"], points, sigma)
    observation_type = PointObservation if in_space else PixelObservation
    return observation_type(data["camera"], data["target"], ids, points, sigma)


def _ids(data: dict[str, Any], field: str, file_line: FileLine, known_ids: frozenset[int], points: Array) -> IntArray:
    if "ids" not in data and len(known_ids) > 1:
        raise file_line.error(f"{field}.ids", f"missing; {data['target']!r} has several points, give their ids")
    written = data.get("ids", [0] * min(len(points), 1))
    ids = whole_numbers(file_line, f"{field}.ids", written)
    if len(known_ids) == 1 and len(points) > 1:
        several = f"{count_text(len(points), 'point')} of {data['target']!r}, which has one"
        raise file_line.error(field, f"{several}: record uncertain detections as `candidates`")
    if len(points) > len(known_ids):
        raise file_line.error(field, f"{count_text(len(points), 'point')}, {data['target']!r} has {len(known_ids)}")
    if len(ids) != len(points):
        raise file_line.error(
            f"{field}.ids",
            f"{count_text(len(ids), 'id')} for {count_text(len(points), 'point')}; expected one id a point",
        )
    distinct = set(written)
    if not known_ids >= distinct:
        unknown = min(distinct - known_ids)
        message = f"id {unknown} is not on {data['target']!r}, whose ids are {min(known_ids)} to {max(known_ids)}"
        raise UnknownPoint(message, data["target"], frozenset(distinct), known_ids)
    if len(distinct) != len(ids):
        twice = int(np.sort(ids)[:-1][np.diff(np.sort(ids)) == 0][0])
        message = f"id {twice} of {data['target']!r} is given twice in one observation"
        raise UnknownPoint(message, data["target"], frozenset(distinct), known_ids)
    return ids
