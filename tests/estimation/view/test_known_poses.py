"""Poses that are remembered are those that `view_poses` finds."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view import known_poses
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.known_poses import KnownPoses
from basecal.estimation.view.view_pose import view_poses
from basecal.geometry import SE3

BOARD = np.array([[x, y, 0.0] for y in range(4) for x in range(5)]) * 0.03


def views(count: int) -> BearingMeasurement:
    rng = np.random.default_rng(5)
    poses = SE3.from_rotvec(
        rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform([-0.1, -0.1, 0.5], [0.1, 0.1, 0.8], (count, 3))
    )
    points = (poses.rotation @ BOARD.T).swapaxes(1, 2) + poses.translation[:, None]
    bearings = points / np.linalg.norm(points, axis=-1, keepdims=True) + 1e-4 * rng.standard_normal(points.shape)
    return BearingMeasurement(BOARD, bearings, np.full(points.shape[:2], 1e3))


def of(poses, measurement: BearingMeasurement):
    seen = measurement.weight > 0
    return poses(measurement.points_in_target, measurement.bearings_in_camera, seen, measurement)


def test_known_poses_are_those_found_anew(monkeypatch):
    """Views asked for again, in another order and beside new ones: as of all at once; only new ones are sought."""
    all_views, known, sought = views(6), KnownPoses(), []

    def counted(points, bearings, seen, measurement):
        sought.append(len(bearings))
        return view_poses(points, bearings, seen, measurement)

    monkeypatch.setattr(known_poses, "view_poses", counted)
    of(known, all_views.take(np.array([0, 1, 2, 3])))
    rows = np.array([5, 2, 0, 4])
    again, anew = of(known, all_views.take(rows)), of(view_poses, all_views.take(rows))
    assert sought == [4, 2]
    np.testing.assert_allclose(again.camera_from_target.matrix, anew.camera_from_target.matrix, atol=1e-9)
    np.testing.assert_allclose(again.cost, anew.cost, rtol=1e-6)
    np.testing.assert_allclose(again.information, anew.information, rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("change", ["weight", "points_in_target"])
def test_other_views_are_not_taken_for_known_ones(change):
    """Of other weights, or of another target, a view is found anew."""
    first, known = views(2), KnownPoses()
    of(known, first)
    other = BearingMeasurement(**{**vars(first), change: 2.0 * getattr(first, change)})
    np.testing.assert_allclose(
        of(known, other).camera_from_target.matrix, of(view_poses, other).camera_from_target.matrix, atol=1e-9
    )
    assert len(known.known) == 4
