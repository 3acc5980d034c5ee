"""Truncated least squares by graduated weights: outliers end with no weight at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.outliers.graduated_truncation import (
    _limit_ratio,
    _point_misfits,
    _weigh_group,
    _weights,
    graduated_truncation,
)
from basecal.estimation.outliers.robust_scale import Scale, robust_scale
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

CHANCE = 1e-4
SIGMA = np.full(6, 1e-3)


def stated(squares):
    return Scale(1.0, np.inf, np.inf, CHANCE)


def mount(state):
    return state.transforms[MOUNT].log()


@pytest.mark.parametrize(("count", "size"), [(0, 0.0), (6, 0.02), (6, 5.0)])
def test_the_end_is_the_mean_of_the_inliers(count, size):
    """With six of twenty poses off by 20 sigmas, or by metres, as if they had not been recorded."""
    errors = 1e-3 * np.random.default_rng(0).standard_normal((20, 6))
    errors[:count, :3] += size
    problem, state = pose_problem(errors, SIGMA)
    np.testing.assert_allclose(mount(graduated_truncation(problem, state, stated)), -errors[count:].mean(0), atol=1e-5)


def test_a_scale_that_is_estimated_serves_too():
    """Sigmas that nobody stated: the scale comes from the deviations in each round."""
    errors = 1e-2 * np.random.default_rng(1).standard_normal((30, 6))
    errors[:8] += 0.5
    problem, state = pose_problem(errors, SIGMA)
    end = graduated_truncation(problem, state, lambda squares: robust_scale(squares, 6, False, CHANCE))
    np.testing.assert_allclose(mount(end), -errors[8:].mean(0), atol=2e-3)


def test_single_points_of_views_of_few_are_weighted_by_themselves():
    """One of five points of every other view is 40 px off: the base is as without these, to 0.1 mm and mrad."""
    made = simulate(Scenario(samples=10, target="points"), 3)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    pixels, weight = group.measurement.pixels.copy(), group.measurement.weight.copy()
    pixels[::2, 1] += (35.0, -20.0)
    weight[::2, 1] = 0.0
    truth = State(made.truth, made.cameras, np.zeros((0, 6)))
    astray = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
    without = problem.with_groups([replace(group, measurement=replace(group.measurement, weight=weight))])
    ours, clean = (graduated_truncation(p, truth, stated) for p in (astray, without))
    name = "eye_base_from_hand_base"
    off = (ours.transforms[name].inverse() @ clean.transforms[name]).log()
    np.testing.assert_allclose(off, 0.0, atol=1e-4)


def test_a_start_that_is_pulled_aside_does_not_matter():
    """From 30 mm and mrad off the same end."""
    errors = 1e-3 * np.random.default_rng(2).standard_normal((20, 6))
    errors[:6] += 0.05
    problem, state = pose_problem(errors, SIGMA)
    away = replace(state, transforms={**state.transforms, MOUNT: SE3.exp(np.full(6, -0.03))})
    np.testing.assert_allclose(
        mount(graduated_truncation(problem, away, stated)),
        mount(graduated_truncation(problem, state, stated)),
        atol=1e-6,
    )


@pytest.mark.parametrize("control", [0.1, 1.0, 7.0])
def test_weights_fall_from_one_to_nothing(control):
    """Between mu / (mu + 1) and its inverse of the limit, as the paper's eq. (14); both ends are met."""
    first, last = control / (control + 1), (control + 1) / control
    ratio = np.array([0.0, 0.99 * first, 1.01 * first, 1.0, 0.99 * last, 1.01 * last, 1e30])
    middle = np.sqrt(control * (control + 1) / ratio[2:5]) - control
    np.testing.assert_allclose(_weights(ratio, control), [1.0, 1.0, *middle, 0.0, 0.0])
    assert middle[0] == pytest.approx(1.0, abs=0.02 * (1 + control))
    assert middle[2] == pytest.approx(0.0, abs=0.02 * (1 + control))


def test_squares_are_told_over_their_limits():
    """Those of no freedoms, which have none, are nothing; infinite ones are huge."""
    scale = Scale(4.0, np.inf, np.inf, CHANCE)
    limit = scale.limit(np.array([6]))[0]
    found = _limit_ratio(MahalanobisSquared(np.array([limit, 3 * limit, np.inf, 5.0]), np.array([6, 6, 6, 0])), scale)
    np.testing.assert_allclose(found, [1.0, 3.0, 1e30 / limit, 0.0])


def points_of_five(count=5):
    """Three views of as many points in pixels, at the truth."""
    made = simulate(Scenario(samples=3, target="points"), 3)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    of = group.measurement
    few = replace(
        of, points_in_target=of.points_in_target[:count], pixels=of.pixels[:, :count], seen=of.seen[:, :count],
        stated=of.stated[:, :count], weight=of.weight[:, :count],
    )  # fmt: skip
    return problem, State(made.truth, made.cameras, np.zeros((0, 6))), replace(group, measurement=few)


def test_points_are_weighted_by_themselves():
    """By the root of their weight, as squares are; poses have none."""
    _, _, group = points_of_five()
    weights = np.array([[0.25, 1.0, 0.0, 4.0, 1.0]] * 3)
    found = _weigh_group(group, weights).measurement.weight
    np.testing.assert_allclose(found, group.measurement.weight * [0.5, 1.0, 0.0, 2.0, 1.0])
    (poses,) = pose_problem(np.zeros((3, 6)), SIGMA)[0].groups
    assert _weigh_group(poses, np.ones((3, 1))).measurement is poses.measurement


@pytest.mark.parametrize("count", [1, 2, 5])
def test_points_of_few_are_off_by_their_pixels(count):
    """Squares over sigma of those that are seen, of two numbers each; a point alone is judged with its view."""
    problem, state, group = points_of_five(count)
    of = group.measurement
    of = replace(
        of, seen=np.where(np.arange(3)[:, None] == 2, False, of.seen), pixels=of.pixels + np.array([3.0, -4.0])
    )
    group = replace(group, measurement=of)
    found = _point_misfits(problem, state, group)
    if count == 1:
        assert (found.value.tolist(), found.freedoms.tolist()) == ([[0.0]] * 3, [[0]] * 3)
        return
    pose = state.camera_from_target(group, problem.stops)
    off = of.residual_px(pose, state.cameras["wrist"])
    np.testing.assert_allclose(found.value[:2], np.sum(off**2, -1)[:2] * of.weight[:2] ** 2, rtol=1e-6)
    assert found.freedoms.tolist() == [[2] * count] * 2 + [[0] * count]
    turned = {
        **state.transforms,
        "eye_flange_from_wrist": state.transforms["eye_flange_from_wrist"] @ SE3.from_rotvec([0, np.pi, 0], [0, 0, 0]),
    }
    behind = _point_misfits(problem, replace(state, transforms=turned), group)
    assert np.all(np.isinf(behind.value[:2]))
    assert np.all(np.isfinite(behind.value[2]))


def test_poses_and_boards_are_not_judged_by_point():
    """Those of twelve points and more by their view."""
    problem, state = pose_problem(np.zeros((3, 6)), SIGMA)
    found = _point_misfits(problem, state, problem.groups[0])
    assert (found.value.tolist(), found.freedoms.tolist()) == ([[0.0]] * 3, [[0]] * 3)
    made = simulate(Scenario(samples=2), 3)
    problem, _ = build_problem(made.cell, made.recording)
    found = _point_misfits(problem, State(made.truth, made.cameras, np.zeros((0, 6))), problem.groups[0])
    assert found.freedoms.tolist() == [[0]] * 2
