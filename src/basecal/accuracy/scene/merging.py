"""Points of all cameras as those of one scene: tracks of two cameras become one where images show one point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import IntArray
from basecal.numerics.batch import concatenate, take
from basecal.numerics.tied_blocks import components


def merged_tracks(ones: Sequence[OneCamera], joins: Mapping[int, Join]) -> Tracks:
    """The image points of all cameras, by points of one scene.

    Args:
        ones: What each camera's images say.
        joins: How those of some indices join the first.
    """
    offsets = np.cumsum([0, *(each.adjustment.tracks.count for each in ones)])
    parts = [replace(each.tracks, point=each.tracks.point + at) for each, at in zip(ones, offsets, strict=False)]
    ties = [np.zeros((0, 2), dtype=np.int64)]
    for index, join in joins.items():
        more, tied = _new_sightings(ones[index].adjustment.tracks, join.sightings)
        parts.append(replace(more, view=ones[index].rows[more.view]))
        ties.append(tied + offsets[[index, 0]])
    tracks = concatenate(parts)
    tracks = replace(tracks, point=components(np.concatenate(ties), int(offsets[-1]))[tracks.point])
    _, which, times = np.unique(
        np.column_stack([tracks.view, tracks.point]), axis=0, return_inverse=True, return_counts=True
    )
    return tracks.take(times[which.ravel()] == 1)[0]


def shared_points(views: SceneViews, tracks: Tracks, second: int) -> tuple[int, tuple[int, int]]:
    """How many points the first camera shares with another, each in two views or more; views of each that show some."""
    camera = views.camera[tracks.view]
    in_views = [np.bincount(tracks.point[camera == each], minlength=tracks.count) for each in (0, second)]
    is_shared = (in_views[0] >= 2) & (in_views[1] >= 2)
    of_both = [np.unique(tracks.view[(camera == each) & is_shared[tracks.point]]) for each in (0, second)]
    return int(is_shared.sum()), (len(of_both[0]), len(of_both[1]))


def _new_sightings(own: Tracks, sightings: Tracks) -> tuple[Tracks, IntArray]:
    """Sightings of points of another camera by features that show none of its own; points that are one, (t, 2).

    A point of its own and another are one if most features of its own that show another show this one.
    """
    known = np.full((own.view.max() + 1, max(own.feature.max(), sightings.feature.max(initial=0)) + 1), -1)
    known[own.view, own.feature] = own.point
    point = known[sightings.view, sightings.feature]
    pairs, votes = np.unique(np.column_stack([point, sightings.point])[point >= 0], axis=0, return_counts=True)
    is_most = votes > np.bincount(pairs[:, 0], votes)[pairs[:, 0]] / 2
    return take(sightings, point < 0), pairs[is_most]
