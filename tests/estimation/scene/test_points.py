"""Points where rays meet, and which of them are well seen."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.points import triangulate
from basecal.estimation.scene.views import Tracks
from basecal.numerics.batch import take
from scene_points import made_scene


def test_exact_rays_meet_in_their_points():
    """Without noise all points are found to a micrometre, and are well seen."""
    scene = made_scene(1, noise=0.0)
    points, is_seen = triangulate(scene.views, scene.tracks, scene.truth)
    assert is_seen.all()
    assert np.abs(points - scene.truth.points).max() < 1e-6


def test_rays_of_one_place_tell_no_depth():
    """A point that one view shows, given three times as if of three views that are one, is not well seen."""
    scene = made_scene(2, noise=0.0)
    same = take(scene.views, np.zeros(3, dtype=np.int64))
    one = np.flatnonzero(scene.tracks.view == 0)[0]
    tracks = Tracks(
        np.arange(3),
        np.zeros(3, dtype=np.int64),
        np.tile(scene.tracks.pixels[one], (3, 1)),
        np.zeros(3, dtype=np.int64),
    )
    assert not triangulate(same, tracks, scene.truth)[1].any()
