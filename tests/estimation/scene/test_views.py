"""Tests of image points grouped by tracks, and of the views that contain them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.scene.views import Tracks
from basecal.numerics.batch import take
from scene_points import LENS, made_scene


def test_points_with_too_few_views_are_left_out():
    """A point that loses an image point and has only two is removed, and the others are renumbered."""
    tracks = Tracks(np.array([0, 1, 2, 0, 1, 2, 3]), np.array([0, 0, 0, 1, 1, 1, 1]), np.zeros((7, 2)), np.arange(7))
    kept, old = tracks.take(np.array([True, True, False, True, True, True, True]))
    assert old.tolist() == [1]
    assert kept.point.tolist() == [0, 0, 0, 0]
    assert kept.count == 1
    assert tracks.count == 2


def test_directions_are_those_of_the_lens():
    """Unit directions project back to the image points."""
    scene = made_scene(1, arms=2)
    unit, valid = scene.views.directions(scene.tracks, (LENS, LENS))
    assert valid.all()
    assert np.abs(np.linalg.norm(unit, axis=1) - 1).max() < 1e-12
    assert np.abs(LENS.project(unit) - scene.tracks.pixels).max() < 1e-6


def test_views_keep_their_stops():
    """Stops of selected views are unchanged, and all stops stay known."""
    views = made_scene(2, arms=2).views
    few = take(views, np.array([3, 20]))
    assert few.stop.tolist() == [3, 20]
    assert len(few.stop_robot) == len(views.stop_robot)


@pytest.mark.parametrize(("fewest", "points"), [(None, [0, 2]), (2, [0, 1, 2]), (4, [2]), (5, [])])
def test_point_needs_three_views(fewest, points):
    """The minimum may be set, and remaining points are renumbered from zero."""
    tracks = Tracks(np.r_[0:3, 0:2, 0:4], np.repeat([0, 1, 2], [3, 2, 4]), np.zeros((9, 2)), np.arange(9))
    kept, old = tracks.take(np.ones(9, dtype=bool), **({} if fewest is None else {"min_views": fewest}))
    assert old.tolist() == points
    assert kept.count == len(points)
    assert sorted(set(kept.point.tolist())) == list(range(len(points)))
    assert len(kept) == sum([3, 2, 4][point] for point in points)


def test_reach_is_the_rms_distance_of_each_arm():
    """The reach is the root mean square distance over each arm's own views."""
    views = made_scene(2, arms=2).views
    for k in (0, 1):
        lengths = np.linalg.norm(views.base_from_flange.translation[views.robot == k], axis=1)
        assert views.reach_m[k] == pytest.approx(np.sqrt(np.mean(lengths**2)))
    assert len(views) == 30


def test_directions_outside_a_lens_are_zero():
    """Image points beyond its domain are invalid, and those of the other camera are valid."""
    scene = made_scene(1, arms=2)
    folded = LENS.with_parameters(np.array([900.0, 900.0, 639.5, 359.5, -0.3, 0, 0, 0, 0]))
    pixels = np.full_like(scene.tracks.pixels, 400.0)
    pixels[4] = pixels[-1] = (1400.0, 359.5)
    unit, valid = scene.views.directions(replace(scene.tracks, pixels=pixels), (LENS, folded))
    assert np.flatnonzero(~valid).tolist() == [len(scene.tracks) - 1]
    assert unit[-1].tolist() == [0, 0, 0]
