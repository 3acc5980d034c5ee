"""Points of all cameras as those of one scene: tracks of two cameras become one where images show one point."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.accuracy.scene.pictures import Pictures
from basecal.estimation.scene.base import project_points
from basecal.estimation.scene.views import FEWEST_VIEWS, Tracks
from basecal.geometry import IntArray

_CUBE_M = 0.15  # [m] sides of the cubes that are places
_FEWEST_IN_CUBE = 4  # points of a place


def merged_tracks(pictures: Pictures, ones: Sequence[OneCamera], joins: Sequence[tuple[int, int, Join]]) -> Tracks:
    """The image points of all cameras, by points of one scene.

    Args:
        pictures: Of all cameras.
        ones: What each camera's images say.
        joins: Indices among `ones` of two that are joined, and how.
    """
    offsets = np.concatenate([[0], np.cumsum([_count(each) for each in ones])]).astype(np.int64)
    rows = [_own_rows(each, offset) for each, offset in zip(ones, offsets, strict=False)]
    ties: list[tuple[int, int]] = []
    for i, k, join in joins:
        more, tied = _sighting_rows(ones[k], join, int(offsets[i]), int(offsets[k]))
        rows.append(more)
        ties += tied
    view, point, feature = (np.concatenate([row[k] for row in rows]) for k in range(3))
    point = _unite_points(point, ties, int(offsets[-1]))
    pixels = np.array([pictures.features[v].pixels[f] for v, f in zip(view, feature, strict=True)]).reshape(-1, 2)
    _, which, times = np.unique(np.column_stack([view, point]), axis=0, return_inverse=True, return_counts=True)
    tracks = Tracks(view, np.unique(point, return_inverse=True)[1].astype(np.int64), pixels)
    return tracks.take(times[which.ravel()] == 1, FEWEST_VIEWS)[0]


def shared_points(pictures: Pictures, tracks: Tracks, cameras: tuple[int, int]) -> tuple[int, tuple[int, int]]:
    """How many points two cameras share, each in two views or more, and how many views of each show some."""
    camera = pictures.views.camera[tracks.view]
    in_views = [np.bincount(tracks.point[camera == each], minlength=tracks.count) for each in cameras]
    is_shared = (in_views[0] >= 2) & (in_views[1] >= 2)
    of_both = [np.unique(tracks.view[(camera == each) & is_shared[tracks.point]]) for each in cameras]
    return int(is_shared.sum()), (len(of_both[0]), len(of_both[1]))


def common_share(first: OneCamera, second: OneCamera, join: Join) -> float:
    """Share of places of the first camera's scene that the second shows, of those predicted within its images.

    Two equal objects, of which each camera sees one, fit; what is around them does not. Places are cubes, which count
    equally, as objects have more texture than what is around them. 1 if no cube has enough points.
    """
    assert first.fit is not None
    assert second.fit is not None
    points, fit = first.fit.state.points, second.fit
    camera_from_world = fit.state.world_from_camera(fit.views).inverse()
    transform = join.second_from_first  # of both cameras' worlds
    pixels = project_points(points, camera_from_world @ transform, fit.state.lenses[0])
    predicted = np.flatnonzero(np.isfinite(pixels).all(-1).sum(0) >= FEWEST_VIEWS)
    found = np.isin(predicted, join.sightings[1])
    cubes = np.floor(points[predicted] / _CUBE_M).astype(np.int64)
    _, number, total = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    share = np.bincount(number.ravel(), found, len(total))[total >= _FEWEST_IN_CUBE] / total[total >= _FEWEST_IN_CUBE]
    return float(np.mean(share >= 0.5)) if len(share) else 1.0


def _count(one: OneCamera) -> int:
    return 0 if one.fit is None else one.fit.tracks.count


def _own_rows(one: OneCamera, offset: int) -> tuple[IntArray, IntArray, IntArray]:
    """View among all, point among all and feature of a camera's own image points."""
    if one.fit is None:
        return (np.zeros(0, dtype=np.int64),) * 3
    return one.rows[one.fit.tracks.view], one.fit.tracks.point + offset, one.feature


def _sighting_rows(
    second: OneCamera, join: Join, first_offset: int, second_offset: int
) -> tuple[tuple[IntArray, IntArray, IntArray], list[tuple[int, int]]]:
    """Image points of the second that show points of the first, and points that are one as most of these have it."""
    known = second.points_by_feature()
    view, point, feature = join.sightings
    votes: dict[int, Counter[int]] = {}
    is_new = np.ones(len(view), dtype=bool)
    for k, (v, p, f) in enumerate(zip(view.tolist(), point.tolist(), feature.tolist(), strict=True)):
        own = known.get((v, f))
        if own is not None:
            is_new[k] = False
            votes.setdefault(own, Counter())[p] += 1
    ties = []
    for own, counted in votes.items():
        p, most = counted.most_common(1)[0]
        if most > sum(counted.values()) / 2:
            ties.append((p + first_offset, own + second_offset))
    return (second.rows[view[is_new]], point[is_new] + first_offset, feature[is_new]), ties


def _unite_points(point: IntArray, ties: Sequence[tuple[int, int]], count: int) -> IntArray:
    """Points renumbered, tied ones as one."""
    one, other = np.array(ties, dtype=np.int64).reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1][point], dtype=np.int64)
