"""How a solution fits: pixels, loops, and what a view says alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.pose_problem import pose_problem

from basecal.accuracy.residuals.fit import residuals, single_view_pose
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve_from
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def fixed_at_truth(scenario, change=None, seed=0):
    """A solution of a cell in which everything is known, of a recording whose group may be changed."""
    known = {"base": "fixed", "camera_mount": "fixed", "target_mount": "fixed"}
    made = simulate(replace(scenario, **known), seed)
    problem, _ = build_problem(made.cell, made.recording)
    if change is not None:
        problem = problem.with_groups(map(change, problem.groups))
    return solve_from(problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))))


def with_pixels(change):
    def of(group):
        pixels, seen = group.measurement.pixels.copy(), group.measurement.seen.copy()
        change(pixels, seen)
        weight = np.where(seen, group.measurement.weight, 0.0)
        measurement = replace(group.measurement, pixels=pixels, seen=seen, weight=weight, stated=weight)
        return replace(group, measurement=measurement)

    return of


EXACT = Scenario(samples=4, pixel_px=1e-6)


def test_pixels_are_per_coordinate():
    """One view 3 px right and 4 px down: 5 / sqrt(2) px of its own, half of that over four views; half are exact."""

    def change(pixels, seen):
        pixels[1] += (3.0, 4.0)

    found = residuals(fixed_at_truth(EXACT, with_pixels(change)))
    by_sample = {r.sample: r.rms_px for r in found.per_sample}
    assert by_sample[1] == pytest.approx(5 / np.sqrt(2), rel=1e-4)
    assert by_sample[0] == pytest.approx(0.0, abs=1e-4)
    assert found.rms_px == pytest.approx(5 / np.sqrt(8), rel=1e-4)
    assert found.median_px == pytest.approx(0.0, abs=1e-4)


def test_points_that_were_not_seen_do_not_count():
    """A corner a thousand pixels off that was not seen changes nothing."""

    def change(pixels, seen):
        pixels[2, 3] += 1e3
        seen[2, 3] = False

    assert residuals(fixed_at_truth(EXACT, with_pixels(change))).rms_px == pytest.approx(0.0, abs=1e-4)


def test_loops_are_those_of_the_recorded_poses():
    """A robot with 1 mm and 2 mrad of noise: pixels fit with its errors taken out, loops are left open by them."""
    solution = fixed_at_truth(Scenario(samples=40, robot_noise=(1e-3, 0.0), pixel_px=0.01))
    found = residuals(solution)
    assert found.rms_px < 0.02
    assert found.loop_rms_m == pytest.approx(1e-3 * np.sqrt(6), rel=0.2)
    lengths = np.array([r.loop_m for r in found.per_sample])
    assert found.loop_rms_m == pytest.approx(np.sqrt(np.mean(lengths**2)))
    angles = np.array([r.loop_rad for r in found.per_sample])
    assert found.loop_rms_rad == pytest.approx(np.sqrt(np.mean(angles**2)))


def test_measured_poses_close_loops_by_what_they_are_off():
    """Half a metre and a third of a radian; there are no pixels."""
    problem, state = pose_problem(np.array([[0.5, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.3, 0]]), np.ones(6))
    found = residuals(solve_from(replace(problem, columns={}), state))
    assert [(r.loop_m, r.rms_px) for r in found.per_sample] == [(pytest.approx(0.5), None), (pytest.approx(0), None)]
    assert found.per_sample[1].loop_rad == pytest.approx(0.3)
    assert found.loop_rms_m == pytest.approx(0.5 / np.sqrt(2))
    assert (found.rms_px, found.median_px) == (None, None)


def test_lights_close_no_loop():
    """A view of one point gives no pose."""
    found = residuals(fixed_at_truth(Scenario(samples=5, target="led")))
    assert (found.loop_rms_m, found.loop_rms_rad) == (None, None)
    assert all(r.loop_m is None and r.loop_rad is None and r.rms_px > 0 for r in found.per_sample)


def test_what_was_left_out_stands_among_the_samples_and_in_no_mean():
    """Samples by number, the two of the views that were left out with residuals of their own."""

    def change(pixels, seen):
        pixels[[1, 3]] += (30.0, 40.0)

    solution = fixed_at_truth(EXACT, with_pixels(change))
    whole = solution.problem
    kept, rest = (whole.with_groups(g.take(np.array(rows)) for g in whole.groups) for rows in ([2, 0], [3, 1]))
    found = residuals(replace(solution, problem=kept), rest)
    assert [r.sample for r in found.per_sample] == [0, 1, 2, 3]
    assert found.rms_px == pytest.approx(0.0, abs=1e-4)
    assert found.per_sample[3].rms_px == pytest.approx(50 / np.sqrt(2), rel=1e-4)


def alone(target, seen_points, samples=3):
    """Of views of which the second saw so many points: the poses they give, the true ones, and which do."""
    made = simulate(Scenario(samples=samples, target=target, pixel_px=1e-4, point_m=1e-6), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    seen[1, [k for k in range(seen.shape[1]) if k not in seen_points]] = False
    weight = np.where(seen, group.measurement.weight, 0.0)
    few = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight, stated=weight))
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    true = state.camera_from_target(group, problem.stops)
    near = true @ SE3.exp(np.full((samples, 6), 0.01))
    return single_view_pose(state, few, near), true


@pytest.mark.parametrize(("target", "points", "enough"), [
    ("charuco", (0, 5, 30, 35), True), ("charuco", (0, 5, 30), False),
    ("points3d", (0, 1, 4), True), ("points3d", (0, 1), False),
])  # fmt: skip
def test_a_view_alone_gives_its_pose_by_enough_points(target, points, enough):
    """Four points in pixels or three in 3-D; the pose is the true one, wherever it starts."""
    (poses, given), true = alone(target, points)
    assert given.tolist() == [True, enough, True]
    off = np.abs((poses.inverse() @ true).log()).max(-1)
    assert np.all(off[given] < 1e-3)


def test_points_on_a_line_give_no_pose():
    """Nor does a light: the prediction is given back, and none is enough."""
    (poses, given), true = alone("led", (0,))
    assert not given.any()
    np.testing.assert_allclose((true.inverse() @ poses).log(), 0.01, atol=1e-12)


def test_points_in_space_count_by_their_sigmas():
    """The pose of a view alone is that of Kabsch's weighted points, by one over their variances."""
    made = simulate(Scenario(samples=2, target="points3d", point_m=5e-3), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    of = group.measurement
    weight = np.random.default_rng(0).uniform(0.1, 3.0, of.weight.shape)
    group = replace(group, measurement=replace(of, weight=weight))
    (found, given) = single_view_pose(State(made.truth, made.cameras, np.zeros((0, 6))), group, None)
    assert given.all()
    for k in range(2):
        share = weight[k] ** 2 / np.sum(weight[k] ** 2)
        here, there = share @ of.points_in_target, share @ of.points_in_camera[k]
        turn, _ = Rotation.align_vectors(of.points_in_camera[k] - there, of.points_in_target - here, weights=share)
        np.testing.assert_allclose(found.rotation[k], turn.as_matrix(), atol=1e-6)
        np.testing.assert_allclose(found.translation[k], there - turn.apply(here), atol=1e-6)
