"""An observation of `samples.jsonl`: pixels, candidates, a pose or 3-D points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell.cell import Cell
from basecal.cell.journal.sample_values import Where, numbers, pose, sigmas, whole_numbers
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
)
from basecal.errors import InputError
from basecal.geometry import Array, IntArray

_BOTH = ("camera", "target")
_FIELDS = {
    "pixels": (*_BOTH, "ids", "pixels", "sigma_px"),
    "candidates": (*_BOTH, "candidates", "sigma_px"),
    "camera_from_target": (*_BOTH, "camera_from_target"),
    "points_in_camera_m": (*_BOTH, "ids", "points_in_camera_m", "sigma_m"),
}
_ANY = tuple(dict.fromkeys(field for fields in _FIELDS.values() for field in fields))


class UnknownPoint(InputError):
    """An observation of a point that is not on the target, or of one point twice.

    Attributes:
        target: What was seen.
        ids: Of the points.
        known: Of the target.
    """

    def __init__(self, message: str, target: str, ids: frozenset[int], known: frozenset[int]) -> None:
        super().__init__(message)
        self.target, self.ids, self.known = target, ids, known


def observation(
    value: Any, field: str, where: Where, cell: Cell, ids: Mapping[str, frozenset[int]]
) -> tuple[tuple[str, str], Observation | None]:
    """Camera and target, and what the one saw of the other; None where that is nothing.

    Raises:
        DatasetError: if it cannot be read as written.
        UnknownPoint: if an id is not on the target, or given twice.
    """
    data = where.mapping(value, field, _ANY)
    kinds = [kind for kind in _FIELDS if kind in data]
    if len(kinds) != 1:
        expected = f"expected exactly one of {', '.join(_FIELDS)}"
        raise where.error(field, f"{expected}, got {' and '.join(kinds) or 'none'}")
    kind = kinds[0]
    where.mapping(data, field, _FIELDS[kind])
    camera = where.name(data.get("camera"), f"{field}.camera", "camera", cell.cameras)
    target = where.name(data.get("target"), f"{field}.target", "target", cell.targets)
    shape = cell.targets[target].target
    if kind == "camera_from_target":
        if shape is not None and shape.is_point:
            raise where.error(
                f"{field}.camera_from_target",
                f"{target!r} is one point, which has no orientation: leave out its `kind` in cell.yaml and state its "
                "mount with a rotation; what sees the point is another target",
            )
        mean, sigma = pose(where, f"{field}.camera_from_target", data[kind], with_sigmas=True)
        return (camera, target), PoseObservation(camera, target, mean, sigma)
    if shape is None:
        raise where.error(f"{field}.target", f"points of {target!r} need its `kind` and shape in cell.yaml")
    if kind == "candidates" and not shape.is_point:
        raise where.error(f"{field}.candidates", f"candidates are for a single light; {target!r} has several points")
    if kind != "points_in_camera_m" and cell.cameras[camera].intrinsics is None:
        raise where.error(f"{field}.camera", f"pixels of {camera!r} need its size_px and intrinsics in cell.yaml")
    return (camera, target), _points(kind, data, field, where, ids[target])


def _points(
    kind: str, data: dict[str, Any], field: str, where: Where, known: frozenset[int]
) -> PixelObservation | CandidateObservation | PointObservation | None:
    """What was seen of points, in pixels or in the camera's frame; None where that is nothing."""
    in_space = kind == "points_in_camera_m"
    points = numbers(where, f"{field}.{kind}", data[kind], 3 if in_space else 2)
    ids = None if kind == "candidates" else _ids(data, field, where, known, points)
    sigma_field = "sigma_m" if in_space else "sigma_px"
    sigma = sigmas(where, f"{field}.{sigma_field}", data.get(sigma_field), len(points))
    if not len(points):
        return None
    if ids is None:
        return CandidateObservation(data["camera"], data["target"], points, sigma)
    noun = PointObservation if in_space else PixelObservation
    return noun(data["camera"], data["target"], ids, points, sigma)


def _ids(data: dict[str, Any], field: str, where: Where, known: frozenset[int], points: Array) -> IntArray:
    if "ids" not in data and len(known) > 1:
        raise where.error(f"{field}.ids", f"missing; {data['target']!r} has several points, say which were seen")
    written = data.get("ids", [0] * min(len(points), 1))
    ids = whole_numbers(where, f"{field}.ids", written)
    if len(known) == 1 and len(points) > 1:
        several = f"{len(points)} places of {data['target']!r}, which is one point; bright spots of which one is it"
        raise where.error(field, f"{several} are its `candidates`")
    if len(points) > len(known):
        raise where.error(field, f"{len(points)} points, {data['target']!r} has {len(known)}")
    if len(ids) != len(points):
        raise where.error(f"{field}.ids", f"{len(ids)} ids for {len(points)} points; expected one id a point")
    distinct = set(written)
    if not known >= distinct:
        unknown = min(distinct - known)
        message = f"id {unknown} is not on {data['target']!r}, whose ids are {min(known)} to {max(known)}"
        raise UnknownPoint(message, data["target"], frozenset(distinct), known)
    if len(distinct) != len(ids):
        twice = int(np.sort(ids)[:-1][np.diff(np.sort(ids)) == 0][0])
        message = f"id {twice} of {data['target']!r} is given twice in one observation"
        raise UnknownPoint(message, data["target"], frozenset(distinct), known)
    return ids
