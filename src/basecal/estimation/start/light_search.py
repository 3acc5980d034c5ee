"""Starts of a target of which a view shows too little for a pose: by the point that most views see, as a light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.start.closed_form import Loop
from basecal.estimation.start.pair_views import PairViews, as_light
from basecal.estimation.start.rotation_grid import light_starts
from basecal.geometry import SE3

Triple = tuple[SE3, SE3, SE3]


def light_search(sight: PairViews, loop: Loop, max_count: int) -> tuple[PairViews, Loop, list[Triple]]:
    """The views of the point that most of them see, as a light, what is known of its loop, and the best starts.

    Args:
        sight: Views of a target, of which some points may be seen, or one.
        loop: What of X, Y and Z is known.
        max_count: How many starts.
    """
    chords, point = as_light(sight.group.measurement)
    views = np.flatnonzero(chords.weight[:, point] > 0)
    few = sight.group.take(views)
    one = replace(chords.take(views), points_in_target=np.zeros((1, 3)))
    one = replace(one, bearings_in_camera=one.bearings_in_camera[:, [point]], weight=one.weight[:, [point]])
    as_point = replace(sight, group=replace(few, measurement=one), weight=sight.weight[views])
    light_z = None if loop.z is None else SE3(np.eye(3), loop.z @ chords.points_in_target[point])
    light = as_point.loop(loop.x, loop.y, light_z, np.zeros(len(views), dtype=np.int64))
    return as_point, light, light_starts(light, one.bearings_in_camera[:, 0], max_count)
