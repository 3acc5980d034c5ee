"""Tests of view errors and view deviations, for all kinds of measurements."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.accuracy.input_check.view_errors import view_deviations, view_errors
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def test_pose_errors_are_angle_and_relative_length():
    """Pose errors are angles and lengths over distance, over six numbers: a third of a radian, and 1 m at 2 m."""
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6))
    (group,) = problem.groups
    far = SE3.exp(np.array([[0, 0, 2.0, 0, 0, 0]] * 3))
    at = replace(group, measurement=replace(group.measurement, measured_camera_from_target=far))
    mount = {**state.transforms, "eye_flange_from_camera": SE3.exp([0, 0, -2.0, 0, 0, 0])}
    exact = replace(state, transforms=mount)
    np.testing.assert_allclose(view_errors(problem, at, exact), 0.0, atol=1e-12)
    off = SE3.exp(np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0.3], [0] * 6]))
    moved = replace(at, measurement=replace(at.measurement, measured_camera_from_target=far @ off))
    np.testing.assert_allclose(view_errors(problem, moved, exact)[[0, 2]] * np.sqrt(6), [0.5, 0.0], atol=0.06)
    assert view_errors(problem, moved, exact)[1] * np.sqrt(6) == pytest.approx(0.3, abs=1e-9)


def errors_of_views(target, change):
    """View errors at the true state of a noise-free recording with a changed measurement."""
    made = simulate(Scenario(samples=4, target=target, pixel_px=0.0, point_m=0.0, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    measurement = change(group.measurement)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    return view_errors(problem, replace(group, measurement=measurement), state), group.reach_m


def test_pixel_errors_are_in_milliradians():
    """Corners 3 px right and 4 px down are off by 5 / sqrt(2) thousandths; unseen ones do not count."""

    def change(of):
        pixels, seen = of.pixels.copy(), of.seen.copy()
        pixels[1] += (3.0, 4.0)
        pixels[2, 0] += 1e4
        seen[2, 0] = False
        return replace(of, pixels=pixels, seen=seen)

    np.testing.assert_allclose(errors_of_views("charuco", change)[0], [0, 5e-3 / np.sqrt(2), 0, 0], atol=1e-9)


def test_point_errors_are_relative_to_reach():
    """3-D points 3 cm off are divided by sqrt(3) and by the reach of the flanges, not the points' distance."""

    def change(of):
        points, seen = of.points_in_camera.copy(), of.seen.copy()
        points[1] += (0.03, 0.0, 0.0)
        points[3, 0] += 9.0
        seen[3, 0] = False
        return replace(of, points_in_camera=points, seen=seen)

    off, reach = errors_of_views("points3d", change)
    np.testing.assert_allclose(off[[0, 2, 3]], 0.0, atol=1e-9)
    assert off[1] == pytest.approx(0.03 / np.sqrt(3) / reach, rel=1e-9)


def test_stop_errors_do_not_reduce_view_errors():
    """View errors use robot poses as recorded: stop errors that explain a view count against a hypothesis."""
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6), stop_sigma=np.full(6, 0.1))
    shifted = replace(state, stop_errors=np.ones((2, 6)))
    np.testing.assert_array_equal(
        view_errors(problem, problem.groups[0], shifted), view_errors(problem, problem.groups[0], state)
    )


def make_measured_views(target, change):
    """Three equal views of a noise-free recording, with a changed measurement."""
    made = simulate(Scenario(samples=4, target=target, pixel_px=0.0, point_m=0.0, state_pixel_noise=False), 0)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    views = group.take(np.array([0, 0, 0]))
    return replace(views, measurement=change(views.measurement))


def test_pixel_deviation_is_from_median():
    """Pixels deviate from their median: one view of three is 6 px aside.

    A point unseen in one view has the median of the others.
    """

    def change(of):
        pixels, seen = of.pixels.copy(), of.seen.copy()
        pixels[1, :, 0] += 6.0
        pixels[2, 0] = 1e5
        seen[2, 0] = False
        return replace(of, pixels=pixels, seen=seen)

    expected = np.sqrt((6.0**2 * np.arange(2) / 2).sum())
    moved = make_measured_views("charuco", change)
    count = moved.measurement.seen.shape[1]
    first = np.sqrt(3.0**2 / (2 * count))  # the median of two views is their mean
    others = np.sqrt((6.0**2 * (count - 1) + 3.0**2) / (2 * count))
    np.testing.assert_allclose(1e3 * view_deviations(moved), [first, others, 0.0], atol=1e-9)
    assert others < expected + 1e-9


def test_deviations_of_points_and_poses_are_relative():
    """Points 0.3 m aside deviate relative to the reach, poses relative to their distance.

    Poses also by their angles.
    """

    def change(of):
        points = of.points_in_camera.copy()
        points[1] += (0.3, 0.0, 0.0)
        return replace(of, points_in_camera=points)

    points = make_measured_views("points3d", change)
    np.testing.assert_allclose(view_deviations(points), [0, 0.3 / np.sqrt(3) / points.reach_m, 0], atol=1e-12)
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    seen = SE3.exp(np.array([[0, 0, 2.0, 0, 0, 0], [0, 0, 2.0, 0, 0, 0], [0.3, 0, 2.0, 0, 0, 0]]))
    poses = views_of(problem, seen)
    np.testing.assert_allclose(view_deviations(poses), [0, 0, 0.15 / np.sqrt(6)], atol=2e-3)


def views_of(problem, camera_from_target):
    """The views of a problem of poses, with these observations."""
    (group,) = problem.groups
    measurement = replace(group.measurement, measured_camera_from_target=camera_from_target)
    return replace(group, measurement=measurement)


def test_deviation_uses_median_pose():
    """Deviations are from the median of each coordinate.

    A view 0.3 m off and one with another angle do not affect the rest.
    """
    problem, _ = pose_problem(np.zeros((5, 6)), np.ones(6))
    seen = np.tile([0.1, 0.2, 2.0, 0, 0, 0], (5, 1))
    seen[1, 0] += 0.3
    seen[3, 5] += 1e-3
    poses = views_of(problem, SE3.exp(seen))
    distance = np.median(np.linalg.norm(SE3.exp(seen).translation, axis=-1))
    expected = [0, 0.3 / distance / np.sqrt(6), 0, 0.8e-3 / np.sqrt(6), 0]
    np.testing.assert_allclose(view_deviations(poses), expected, atol=1.5e-4)


def test_view_of_one_point_counts_its_coordinates():
    """A view of one point counts its own coordinates only, and a view without points has zero error."""

    def change(of):
        pixels, seen = of.pixels.copy(), np.zeros_like(of.seen)
        seen[[0, 2, 3]] = True
        seen[0, 1:] = False
        pixels[0] += (3.0, 4.0)
        return replace(of, pixels=pixels, seen=seen)

    np.testing.assert_allclose(errors_of_views("charuco", change)[0], [5e-3 / np.sqrt(2), 0, 0, 0], atol=1e-9)


def test_unknown_measurement_is_input_error():
    """A measurement that is neither pixels, poses nor points raises an InputError."""
    with pytest.raises(InputError, match="expected pixels, poses or points"):
        view_deviations(SimpleNamespace(measurement=object()))
