"""Tests of bounds of a view's cost by its rotation away from the view's own pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.estimation.certificate.view_rotation import ViewCosts, view_costs
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

SMALL_RAD = 1e-3


def views_of(target):
    """Group, camera, costs and poses of three views of a board, in pixels, as points or as poses."""
    problem, state, group = problem_at_truth(Scenario(samples=3, target=target))
    return (
        group,
        state.cameras.get(group.camera),
        view_costs(problem, state, group),
        view_poses_near_truth(problem, state),
    )


def problem_at_truth(scenario: Scenario):
    """A simulated problem of one group, its true state, and the group."""
    made = simulate(scenario, 4)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    return problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))), group


def view_poses_near_truth(problem, state):
    """The views' own poses if measured, else the true ones."""
    measured = getattr(problem.groups[0].measurement, "measured_camera_from_target", None)
    return measured or state.camera_from_target(problem.groups[0], problem.stops)


def rotated_cost(group, camera, costs, near, turns):
    """The least cost over translations of views rotated by rotation vectors (k, 3), (k, n)."""
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
def test_cost_increases_at_least_as_bounded(target, angle, rng):
    """Rotated about any axis, a view costs more than its constant plus the weight times sin^2 of half the angle."""
    group, camera, costs, near = views_of(target)
    cost = rotated_cost(group, camera, costs, near, angle * directions(rng, 30))
    bound = costs.constant + costs.weight * np.sin(angle / 2) ** 2
    assert np.all(cost >= bound - 1e-6 * np.abs(bound))


@pytest.mark.parametrize(("target", "share"), [("charuco", 0.5), ("points3d", 1.0), ("pose", 1.0)])
def test_bound_is_as_tight_as_stated(target, share, rng):
    """About the worst axis a small rotation costs the bound.

    For pixels, whose curvature is halved, it costs twice that.
    """
    group, camera, costs, near = views_of(target)
    rise = rotated_cost(group, camera, costs, near, SMALL_RAD * directions(rng, 500)) - costs.constant
    ratio = costs.weight * np.sin(SMALL_RAD / 2) ** 2 / np.min(rise, axis=0)
    np.testing.assert_allclose(ratio, share, rtol=0.05)


def test_ambiguous_views_have_no_weight():
    """A view whose second pose costs more by less than the slack has no weight, and the others keep theirs."""
    costs = ViewCosts(SE3.identity((3,)), np.array([1.0, 1.0, 1.0]), np.ones(3), np.array([2.0, 11.0, np.inf]))
    np.testing.assert_array_equal(costs.without_doubtful(5.0).weight, [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(costs.without_doubtful(0.5).weight, [1.0, 1.0, 1.0])
    dear = costs._replace(constant=np.full(3, 4.0), second=np.array([8.9, 9.1, np.inf]))
    np.testing.assert_array_equal(dear.without_doubtful(5.0).weight, [0.0, 1.0, 1.0])


def test_measured_pose_costs_by_its_smallest_weight():
    """The weight is four times the smallest rotation weight squared, and the constant is zero."""
    problem, state = pose_problem(np.zeros((3, 6)), None)
    (group,) = problem.groups
    weight = np.array([[1, 1, 1, 3, 4, 5], [9, 9, 9, 8, 7, 6], [1, 2, 0.1, 6, 2, 4]], dtype=float)
    poses = SE3.exp(0.1 * np.arange(18.0).reshape(3, 6))
    of_poses = replace(group, measurement=PoseMeasurement(poses, weight, weight))
    found = view_costs(problem, state, of_poses)
    np.testing.assert_allclose(found.weight, [36.0, 144.0, 16.0])
    np.testing.assert_array_equal(found.constant, np.zeros(3))
    np.testing.assert_array_equal(found.second, np.full(3, np.inf))
    np.testing.assert_array_equal(found.camera_from_target.rotation, poses.rotation)


@pytest.mark.parametrize(
    ("half", "least", "scatter"), [((3, 2, 1), 4 * (8 + 2), 28), ((3, 2, 0), 4 * 8, 26), ((3, 0, 0), 0.0, 18)]
)
def test_point_views_cost_by_their_spread(half, least, scatter):
    """The weight is four times the two smaller sums of squares.

    The points are pairs at 3, 2 and 1 m along three axes, each with weight 1.
    """
    points = np.array([sign * size * axis for size, axis in zip(half, np.eye(3), strict=True) for sign in (-1, 1)])
    poses = SE3.exp(np.array([[0.1, 0.2, 0.3, 0.4, -0.5, 0.6], [0.0, 1.0, 2.0, -1.0, 0.3, 0.2]]))
    seen = 1.1 * points @ poses.rotation.mT + np.array([5.0, -4.0, 3.0])
    problem, state = pose_problem(np.zeros((2, 6)), None)
    for times in (1.0, 10.0):
        weight = np.full((2, 6), times)
        of_points = PointMeasurement(points + np.array([0.7, 0.1, -2.0]), seen, weight > 0, weight, weight)
        found = view_costs(problem, state, replace(problem.groups[0], measurement=of_points))
        np.testing.assert_allclose(found.weight, 1.1 * least * times**2, atol=1e-9)
        np.testing.assert_allclose(found.constant, 0.01 * scatter * times**2, atol=1e-9)
        if half[2]:
            np.testing.assert_allclose(found.camera_from_target.rotation, poses.rotation, atol=1e-9)


def test_points_of_zero_weight_have_no_effect():
    """Coordinates of points without weight have no effect on a view's cost, and a mirror image is no pose."""
    points = np.array([[3.0, 0, 0], [-3, 0, 0], [0, 2, 0], [0, -2, 0], [0, 0, 1], [0, 0, -1]])
    weight = np.array([[1.0, 1, 1, 1, 1, 1, 0]])
    problem, state = pose_problem(np.zeros((1, 6)), None)
    far, mirrored = np.vstack([points, [50.0, 60.0, 70.0]])[None], np.vstack([points * [1, 1, -1], np.zeros(3)])[None]

    def found(seen):
        """The costs for a target with one more point."""
        of = PointMeasurement(np.vstack([points, [9.0, 9.0, 9.0]]), seen, weight > 0, weight, weight)
        return view_costs(problem, state, replace(problem.groups[0], measurement=of))

    np.testing.assert_allclose(found(far).weight, 4 * (8 + 2))
    np.testing.assert_allclose(found(far).constant, 0.0, atol=1e-9)
    assert np.linalg.det(found(mirrored).camera_from_target.rotation[0]) == pytest.approx(1.0)
    np.testing.assert_allclose(found(mirrored).weight, 4 * (8 - 2))
    np.testing.assert_allclose(found(mirrored).constant, 2 * 28 - 2 * (18 + 8 - 2))


def test_unseen_and_unweighted_corners_are_ignored():
    """A view without usable corners, or with three, has no weight.

    The coordinates of such corners do not affect the others.
    """
    problem, state, group = problem_at_truth(Scenario(samples=4))
    of = group.measurement
    whole = view_costs(problem, state, group)
    seen, weight, pixels = of.seen.copy(), of.weight.copy(), of.pixels.copy()
    seen[0], weight[0], weight[1, 3:], seen[2, 30:] = False, 0.0, 0.0, False
    pixels[:, 30:] = 7e4
    some = replace(group, measurement=replace(of, seen=seen, weight=weight, pixels=pixels))
    found = view_costs(problem, state, some.take(np.array([0, 1, 2])))
    assert found.weight[:2].tolist() == found.constant[:2].tolist() == [0.0, 0.0]
    fewer = replace(group, measurement=replace(of, seen=seen, weight=np.where(seen, of.weight, 0.0)))
    expected = view_costs(problem, state, fewer.take(np.array([2])))
    np.testing.assert_allclose(found.weight[2], expected.weight[0], rtol=1e-6)
    np.testing.assert_allclose(found.constant[2], expected.constant[0], rtol=1e-6)
    assert whole.weight[2] > found.weight[2] > 0
    none = replace(group, measurement=replace(of, seen=0 * of.seen > 0, weight=0 * of.weight))
    nothing = view_costs(problem, state, none)
    assert not nothing.weight.any()
    assert not nothing.constant.any()
    assert np.isinf(nothing.second).all()


def test_planar_board_has_a_second_pose():
    """The second pose is worse than the first at a slanted view, and its cost is that of the points around it."""
    problem, state, group = problem_at_truth(Scenario(samples=4))
    found = view_costs(problem, state, group)
    camera = state.cameras[group.camera]
    cost = group.measurement.linearise(found.camera_from_target, camera, False).cost
    np.testing.assert_allclose(found.constant, cost, rtol=1e-9)
    off = found.camera_from_target.inverse() @ state.camera_from_target(group, problem.stops)
    assert np.abs(off.log()).max() < 0.05
    assert np.all(found.second > found.constant)
    information = group.measurement.linearise(found.camera_from_target, camera, False).information
    left = np.linalg.inv(np.linalg.inv(information)[:, 3:, 3:])
    np.testing.assert_allclose(found.weight, 2 * np.linalg.eigvalsh(left)[:, 0], rtol=1e-5)


def test_view_of_three_points_has_zero_weight():
    """A view of three points costs nothing at any rotation, and the other views keep their costs."""
    problem, state, group = problem_at_truth(Scenario(samples=3))
    whole = view_costs(problem, state, group)
    seen = group.measurement.seen.copy()
    seen[1, 3:] = False
    few = replace(group, measurement=replace(group.measurement, seen=seen, weight=seen * group.measurement.weight))
    found = view_costs(problem.with_groups([few]), state, few)
    assert (found.constant[1], found.weight[1]) == (0.0, 0.0)
    for part in ("constant", "weight"):
        np.testing.assert_allclose(getattr(found, part)[[0, 2]], getattr(whole, part)[[0, 2]], rtol=1e-6)
    assert np.all(whole.weight > 0)


def test_weights_below_one_are_used():
    """Noise a thousand times as large costs a millionth, with the same poses."""
    problem, state, group = problem_at_truth(Scenario(samples=3))
    faint = replace(group, measurement=replace(group.measurement, weight=1e-3 * group.measurement.weight))
    whole, found = view_costs(problem, state, group), view_costs(problem, state, faint)
    for part in ("constant", "weight", "second"):
        np.testing.assert_allclose(getattr(found, part), 1e-6 * getattr(whole, part), rtol=1e-5)
    np.testing.assert_allclose(found.camera_from_target.matrix, whole.camera_from_target.matrix, atol=1e-6)
    assert (whole.weight > 0).all()
