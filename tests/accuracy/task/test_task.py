"""Where the work is done."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.task.expected_error import point_covariances
from basecal.accuracy.task.task import Task, base_transforms, least_known, make_task
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def covariance(scale: float = 1.0) -> np.ndarray:
    root = scale * np.random.default_rng(2).standard_normal((6, 6))
    return root @ root.T


def test_variance_is_the_mean_over_the_points():
    """That of each point by itself, averaged."""
    points = np.array([[0.1, 0.2, -0.3], [1.0, 0, 0]])
    each = np.trace(point_covariances(covariance(), points), axis1=1, axis2=2)
    assert Task("a_from_b", points).variance_m2(covariance()) == pytest.approx(each.mean())


def test_points_are_carried_to_where_the_transform_starts():
    """A point of the reference's base in the axes of the other one."""
    base = SE3.from_rotvec([0, 0, np.pi / 2], [1, 0, 0])
    task = make_task("eye_base_from_hand_base", {"eye_base_from_hand_base": base}, np.array([[1.0, 2.0, 0.0]]))
    np.testing.assert_allclose(task.points_m, [[2, 0, 0]], atol=1e-15)


def test_the_least_known_of_several():
    """That with the largest error at its points."""
    tasks = [Task(name, np.zeros((1, 3))) for name in ("a_from_b", "a_from_c")]
    assert least_known(tasks, {"a_from_b": covariance(), "a_from_c": covariance(2.0)}) is tasks[1]


def test_what_is_placed_in_the_reference():
    """A base between robots, else what stands on the world; a lone mount on a flange is no place."""
    assert base_transforms(simulate(Scenario(samples=2), 0).cell) == ["eye_base_from_hand_base"]
    assert base_transforms(simulate(Scenario(samples=2, layout="eye_in_hand"), 0).cell) == ["arm_base_from_board"]
    lone = simulate(Scenario(samples=2, layout="eye_in_hand", target_mount="fixed"), 0).cell
    with pytest.raises(InputError, match="task point"):
        base_transforms(lone)
