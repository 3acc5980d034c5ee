"""Bounds of a view's cost by how far its rotation is from the view's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.certificate.view_rotation import ViewCosts, view_costs
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

SMALL_RAD = 1e-3


def views_of(target):
    """Problem, state, group and costs of three views of a board, in pixels, as points or as poses."""
    made = simulate(Scenario(samples=3, target=target), 4)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    (group,) = problem.groups
    return group, made.cameras.get(group.camera), view_costs(problem, state, group), near_of(problem, state)


def near_of(problem, state):
    """Where the views are: their own poses where these were measured, else the true ones."""
    measured = getattr(problem.groups[0].measurement, "measured_camera_from_target", None)
    return measured or state.camera_from_target(problem.groups[0], problem.stops)


def cost_turned(group, camera, costs, near, turns):
    """Least cost over translations of each view turned from its own rotation by rotation vectors (k, 3), (k, n)."""
    k, n = len(turns), len(group)
    rotation = costs.camera_from_target.rotation @ SE3.from_rotvec(turns, np.zeros((k, 3))).rotation[:, None]
    pose = SE3(rotation.reshape(-1, 3, 3), np.tile(near.translation, (k, 1)))
    measurement = group.measurement.take(np.tile(np.arange(n), k))
    for _ in range(4):
        view = measurement.linearise(pose, camera, False)
        step = -np.linalg.solve(view.information[:, :3, :3], view.gradient[:, :3, None])[..., 0]
        pose = pose @ SE3.exp(np.concatenate([step, np.zeros_like(step)], -1))
    return measurement.linearise(pose, camera, False).cost.reshape(k, n)


def directions(rng, count):
    axes = np.concatenate([np.eye(3), rng.normal(size=(count, 3))])
    return axes / np.linalg.norm(axes, axis=1)[:, None]


@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
@pytest.mark.parametrize("angle", [SMALL_RAD, 0.05, 0.2])
def test_cost_rises_at_least_so_fast(target, angle, rng):
    """Turned about any axis a view costs more than its constant and the weight times sin^2 of half the angle."""
    group, camera, costs, near = views_of(target)
    cost = cost_turned(group, camera, costs, near, angle * directions(rng, 30))
    bound = costs.constant + costs.weight * np.sin(angle / 2) ** 2
    assert np.all(cost >= bound - 1e-6 * np.abs(bound))


@pytest.mark.parametrize(("target", "share"), [("charuco", 0.5), ("points3d", 1.0), ("pose", 1.0)])
def test_bound_is_as_sharp_as_it_says(target, share, rng):
    """About the worst axis a small turn costs the bound, and for pixels, whose curvature is halved, twice that."""
    group, camera, costs, near = views_of(target)
    rise = cost_turned(group, camera, costs, near, SMALL_RAD * directions(rng, 500)) - costs.constant
    ratio = costs.weight * np.sin(SMALL_RAD / 2) ** 2 / np.min(rise, axis=0)
    np.testing.assert_allclose(ratio, share, rtol=0.05)


def test_doubtful_views_count_for_nothing():
    """A view whose second pose costs less than the slack more has no weight, the others keep theirs."""
    costs = ViewCosts(SE3.identity((3,)), np.array([1.0, 1.0, 1.0]), np.ones(3), np.array([2.0, 11.0, np.inf]))
    np.testing.assert_array_equal(costs.without_doubtful(5.0).weight, [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(costs.without_doubtful(0.5).weight, [1.0, 1.0, 1.0])


def test_a_view_of_three_points_proves_nothing():
    """It costs nothing however it is turned, and the others what they did."""
    made = simulate(Scenario(samples=3), 4)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    (group,) = problem.groups
    whole = view_costs(problem, state, group)
    seen = group.measurement.seen.copy()
    seen[1, 3:] = False
    few = replace(group, measurement=replace(group.measurement, seen=seen, weight=seen * group.measurement.weight))
    found = view_costs(problem.with_groups([few]), state, few)
    assert (found.constant[1], found.weight[1]) == (0.0, 0.0)
    for part in ("constant", "weight"):
        np.testing.assert_allclose(getattr(found, part)[[0, 2]], getattr(whole, part)[[0, 2]], rtol=1e-6)
    assert np.all(whole.weight > 0)
