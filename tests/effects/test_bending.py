"""Tests of an arm that bends: it rotates about its base."""

from __future__ import annotations

import numpy as np

from basecal.effects.bending import candidates as sag
from basecal.geometry import SE3
from basecal.simulation import Scenario
from made_views import moved_by_pose, views_of


def test_bending_rotates_arm_about_base():
    """One unit of bending rotates the arm about its base by reach x down, along the base's axis or in any direction."""
    of = views_of(Scenario(samples=12))
    pose = of.recorded_pose(0, "hand")
    down = np.array([0.3, -0.2, -1.0])
    turn = np.concatenate([np.zeros((12, 3)), 1e-6 * np.cross(pose.translation, down)], -1)
    along, anywhere = (c.moves[0][:, 0] for c in sag(of) if c.about == ("hand",))
    np.testing.assert_allclose(1e-6 * anywhere @ down, moved_by_pose(of, "hand", SE3.exp(turn) @ pose), atol=1e-10)
    np.testing.assert_array_equal(along, anywhere[..., 2:])
