"""Tests of poses that are stretched along some directions."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import FoundEffect
from basecal.effects.stretch import candidates, words
from basecal.geometry import SE3
from basecal.simulation import Scenario
from made_views import moved_by_pose, views_of


def test_stretch_shifts_positions_by_symmetric_matrix():
    """Three axes and three pairs of them are stretched; no flange rotates."""
    of = views_of(Scenario(samples=12))
    pose = of.recorded_pose(0, "hand")
    coefficients = 1e-6 * np.array([1.0, -2.0, 0.5, 3.0, 1.5, -1.0])
    xx, yy, zz, yz, xz, xy = coefficients * np.repeat([1.0, 2**-0.5], 3)
    stretch = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moved = SE3(pose.rotation, pose.translation + pose.translation @ stretch)
    (moves,) = (c.moves[0][:, 0] for c in candidates(of) if c.about == ("hand",))
    np.testing.assert_allclose(moves @ coefficients, moved_by_pose(of, "hand", moved), atol=1e-10)


def test_no_stretch_candidates_with_recorded_joints():
    """Arms that record joints have link parameters instead."""
    assert list(candidates(views_of(Scenario(samples=12, joints=True)))) == []


def test_stretch_message_has_percent():
    """The message gives the stretch in percent with its sigma."""
    size = np.array([1e-3, 0, 0, 0, 0, 0])
    found = FoundEffect("stretch", "stretch", "eye", False, False, None, "", size, 1e-8 * np.eye(6), np.zeros(1))
    assert words(found).what == "Poses of eye are stretched by 0.100 ± 0.010 %, not equally in all directions."
