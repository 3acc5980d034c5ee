"""What moves views, by the views of a solved problem."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.effects.faces.views import elapsed_share, frame_moves, mount_moves, robot_moves
from basecal.simulation import Scenario
from made_views import views_of

MOUNT = "eye_flange_from_wrist"
SCENARIO = Scenario(samples=6, target="led")


def test_only_views_that_a_robot_carries_an_end_of_are_moved():
    """By what is computed for their group."""
    views = views_of(SCENARIO)
    assert robot_moves(views, "eye", lambda _, k, robot: (k, robot)) == ((0, "eye"),)
    assert robot_moves(views, "nobody", lambda *_: pytest.fail("nobody carries anything")) == (None,)


@pytest.mark.parametrize("status", ["free", "fixed"])
def test_an_open_mount_is_its_pose_under_the_mean_of_gravity(status):
    """What is equal in all poses moves nothing; a mount that is fixed is stated without gravity."""
    views = views_of(replace(SCENARIO, camera_mount=status))
    pulls = []

    def move(down):
        """A turn by each direction of gravity."""
        pulls.append(down)
        return np.concatenate([np.zeros((len(down), 3, 1)), down[..., None]], axis=1)

    (moved,) = mount_moves(views, MOUNT, move)
    down = views.down_in_flange(0, "eye")
    np.testing.assert_allclose(pulls[0], down - (0.0 if status == "fixed" else down.mean(0)), atol=1e-15)
    np.testing.assert_allclose(moved, views.flange_jacobian(0, "eye") @ move(pulls[0]))
    assert mount_moves(views, "hand_flange_from_board", move)[0].shape == (6, 6, 1)


def test_a_point_has_no_rotation():
    """Three tangents of its mount, six of another; none of a transform that views do not depend on."""
    views = views_of(SCENARIO)
    assert frame_moves(views, 0, "hand_flange_from_board").shape == (6, 6, 3)
    assert frame_moves(views, 0, MOUNT).shape == (6, 6, 6)
    assert frame_moves(views, 0, "left_flange_from_other") is None


def test_time_passes_from_nothing_to_one():
    """Of the time from the first sample to the last; none passes within one instant."""
    np.testing.assert_allclose(elapsed_share(SimpleNamespace(times=np.array([3.0, 4.0, 7.0]))), [0, 0.25, 1])
    assert elapsed_share(SimpleNamespace(times=np.array([3.0, 3.0]))).tolist() == [0, 0]
