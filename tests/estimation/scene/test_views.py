"""Image points by the point that they show, and the views that have them."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.views import Tracks
from basecal.numerics.batch import take
from scene_points import LENS, made_scene


def test_points_that_too_few_views_show_are_left_out():
    """Of three points one is seen twice only once an image point is dropped; the others are numbered anew."""
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
    """The stops of taken views are the same, and all stops stay known."""
    views = made_scene(2, arms=2).views
    few = take(views, np.array([3, 20]))
    assert few.stop.tolist() == [3, 20]
    assert len(few.stop_robot) == len(views.stop_robot)
