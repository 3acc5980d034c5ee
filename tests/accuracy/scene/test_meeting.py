"""The error where flanges meet by a base from a scene."""

from __future__ import annotations

from functools import cache

import numpy as np

from basecal.accuracy.scene.meeting import scene_meeting
from basecal.accuracy.scene.shared_errors import shared_covariance
from basecal.cell import Cell
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from basecal.estimation.settings import Settings
from basecal.geometry import Array
from scene_points import ARM_M, ARM_RAD, BASE, made_scene


@cache
def fitted(seed: int) -> SceneFit:
    """Two arms, twelve images each."""
    scene = made_scene(seed, arms=2, count=12, points=100)
    return fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None, None))


def described(is_total: bool = False) -> Cell:
    """The cell of these arms, whose noise may be stated as all that they are off by."""
    stated = {"noise": {"sigma_t_m": ARM_M, "sigma_r_rad": ARM_RAD, "kind": "total"}} if is_total else {}
    return cell_from_dict(
        {
            "schema": "basecal/cell/1",
            "reference": "left",
            "target": "scene",
            "robots": {"left": stated, "right": stated},
            "cameras": {"left_eye": {"on": "left"}, "right_eye": {"on": "right"}},
        }
    )


def whole_covariance(fit: SceneFit) -> Array:
    """Of all columns but errors of stops."""
    return scene_covariance(fit) + shared_covariance(fit, 0) + shared_covariance(fit, 1)


def test_the_error_is_expected_where_the_arms_worked() -> None:
    """Of four scenes errors of base and stops have the expected size within a factor of two."""
    squares, variances = [], []
    for seed in range(4):
        fit = fitted(seed)
        meeting = scene_meeting(described(), fit, whole_covariance(fit), Settings())
        assert meeting is not None
        assert meeting.where == "recorded places"
        at = fit.state.world_from_flange(fit.views).translation
        off = (BASE @ fit.state.bases[1].inverse() @ at) - at
        squares.append(np.mean(np.sum(off**2, 1)) / 3 + 2 * ARM_M**2)
        variances.append(meeting.variance_m2 / 3)
        assert meeting.expected_95_m > 1.5 * np.sqrt(variances[-1])
    assert 0.5 < np.sqrt(np.mean(squares) / np.mean(variances)) < 2


def test_it_is_expected_at_the_task() -> None:
    """A point 2 m away, at which neither arm was, is known less than the middle; a point has its own words."""
    fit = fitted(1)
    near, far = (
        scene_meeting(described(), fit, whole_covariance(fit), Settings(task_point=point))
        for point in ((0.7, 0.0, 0.4), (0.7, 2.0, 0.4))
    )
    assert near is not None
    assert far is not None
    assert near.where == "task point"
    assert far.expected_95_m > 1.3 * near.expected_95_m


def test_arms_that_share_no_errors_meet_better() -> None:
    """By the noise of base and stops alone, as computed for one point by hand."""
    fit, point = fitted(1), np.array([0.7, 0.0, 0.4])
    alone = scene_meeting(described(is_total=True), fit, scene_covariance(fit), Settings(task_point=tuple(point)))
    shared = scene_meeting(described(), fit, whole_covariance(fit), Settings(task_point=tuple(point)))
    assert alone is not None
    assert shared is not None
    x, y, z = fit.state.bases[1].inverse() @ point
    by_base = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
    base = fit.columns.bases[1]
    stops = sum(np.sum(fit.stop_sigma[fit.views.stop_robot == k][0, :3] ** 2) for k in (0, 1))
    expected_m2 = np.trace(by_base @ scene_covariance(fit)[base, base] @ by_base.T) + stops
    assert np.isclose(alone.variance_m2, expected_m2)
    assert shared.variance_m2 > 1.05 * alone.variance_m2


def test_one_arm_meets_nobody() -> None:
    """Nothing is placed in the reference's base."""
    scene = made_scene(2, count=12, points=100)
    fit = fit_scene(scene.views, scene.tracks, scene.truth, scene.truth.lenses, (None,))
    cell = cell_from_dict(
        {
            "schema": "basecal/cell/1",
            "reference": "left",
            "target": "scene",
            "robots": {"left": {}},
            "cameras": {"left_eye": {"on": "left"}},
        }
    )
    assert scene_meeting(cell, fit, scene_covariance(fit), Settings()) is None
