"""Tests of a robot's length scale."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.length_scale import candidates
from basecal.geometry import SE3
from basecal.simulation import Scenario
from made_views import moved_by_pose, views_of


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_length_scale_lengthens_poses(robot):
    """One unit of a robot's length scale makes its poses twice as long, to first order."""
    of = views_of(Scenario(samples=12))
    pose = of.recorded_pose(0, robot)
    longer = SE3(pose.rotation, (1 + 1e-6) * pose.translation)
    (found,) = [c for c in candidates(of) if c.about == (robot,)]
    assert found.sizes == 1
    np.testing.assert_allclose(1e-6 * found.moves[0][:, 0, :, 0], moved_by_pose(of, robot, longer), atol=1e-11)
