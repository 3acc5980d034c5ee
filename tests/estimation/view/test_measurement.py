"""Tests of linearised views, against differences of their cost and against explicit Jacobians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.derivatives import check_derivative

from basecal.estimation.problem.build import build_problem
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import Measurement, Noise, limit_equations
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Camera
from basecal.numerics.batch import stack
from basecal.simulation import Scenario, simulate

LENS = Camera("pinhole", np.array([900.0, 880, 640, 360, -0.1, 0.05, 1e-3, -2e-3, 0.01]), (1280, 720))
FISHEYE = Camera("fisheye", np.array([400.0, 410, 640, 360, 0.02, -0.01, 3e-3, -1e-3]), (1280, 720))
KINDS = ["pixels", "fisheye pixels", "bearings", "pose", "points"]
RESIDUALS = {"with residuals": 1.0, "without": 0.0}


def facing_poses(rng: np.random.Generator, n: int, distance: float) -> SE3:
    turn = SE3.exp(np.concatenate([0.05 * rng.standard_normal((n, 3)), 0.4 * rng.standard_normal((n, 3))], -1))
    return SE3(turn.rotation, turn.translation + np.array([0.0, 0.0, distance]))


def random_points(rng: np.random.Generator, offset: float = 0.1) -> np.ndarray:
    return 0.1 * rng.standard_normal((7, 3)) + offset


def random_weights(rng: np.random.Generator, n: int, p: int, sigma: float) -> np.ndarray:
    return rng.uniform(0.5, 2, (n, p)) / sigma * (rng.uniform(size=(n, p)) < 0.8)


def pixels_of(camera: Camera, pose: SE3, points: np.ndarray, weight: np.ndarray, off: np.ndarray) -> PixelMeasurement:
    seen = camera.project((pose.rotation @ points.T).swapaxes(1, 2) + pose.translation[:, None])
    return PixelMeasurement(points, seen + off, weight > 0, weight, weight)


def make_measurement(kind: str, residual: float) -> tuple[Measurement, SE3, Camera | None]:
    """A measurement of 4 views, the poses of its linearisation, and the lens."""
    rng = np.random.default_rng(3)
    pose, points = facing_poses(rng, 4, 0.9), random_points(rng)
    in_camera = (pose.rotation @ points.T).swapaxes(1, 2) + pose.translation[:, None]
    if kind == "pose":
        off = SE3.exp(residual * 0.3 * rng.standard_normal((4, 6)))
        weight = np.full((4, 6), 10.0)
        return PoseMeasurement(pose @ off, weight, weight), pose, None
    weight = random_weights(rng, 4, 7, 0.1)
    if kind == "points":
        off = residual * 0.05 * rng.standard_normal((4, 7, 3))
        return PointMeasurement(points, in_camera + off, weight > 0, weight, weight), pose, None
    if kind == "bearings":
        bearings = in_camera + residual * 0.05 * rng.standard_normal((4, 7, 3))
        unit = bearings / np.linalg.norm(bearings, axis=-1, keepdims=True)
        return BearingMeasurement(points, unit, weight), pose, None
    camera = FISHEYE if kind == "fisheye pixels" else LENS
    off = residual * 20 * rng.standard_normal((4, 7, 2))
    return pixels_of(camera, pose, points, weight / 100, off), pose, camera


@pytest.mark.parametrize("residual", RESIDUALS)
@pytest.mark.parametrize("kind", KINDS)
def test_gradient_is_half_the_slope_of_the_cost(kind, residual):
    """The slope is by central differences of sixth order."""
    measurement, pose, camera = make_measurement(kind, RESIDUALS[residual])

    def half_cost(xi: np.ndarray) -> np.ndarray:
        return 0.5 * measurement.linearise(pose @ SE3.exp(xi), camera, False).cost[:, None]

    gradient = measurement.linearise(pose, camera, False).gradient
    check_derivative(half_cost, gradient[:, None], step=3e-3, tolerance=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_information_is_the_slope_of_the_gradient_without_residuals(kind):
    """Without residuals the second derivative is J'J alone."""
    measurement, pose, camera = make_measurement(kind, 0.0)
    information = measurement.linearise(pose, camera, False).information
    check_derivative(
        lambda xi: measurement.linearise(pose @ SE3.exp(xi), camera, False).gradient, information, 3e-3, 1e-8
    )


@pytest.mark.parametrize("kind", KINDS)
def test_noisier_views_have_less_information(kind):
    """With sigmas twice as large all is a quarter."""
    measurement, pose, camera = make_measurement(kind, 1.0)
    for plain, noisier in zip(
        measurement.linearise(pose, camera, False),
        measurement.noisier(2.0).linearise(pose, camera, False),
        strict=True,
    ):
        np.testing.assert_allclose(4 * noisier, plain, rtol=1e-12, atol=1e-12 * np.abs(plain).max())


@pytest.mark.parametrize("own", [False, True], ids=["shared", "own"])
@pytest.mark.parametrize("kind", KINDS)
def test_batch_equals_separate_linearisations(kind, own):
    """Poses are (3, 4), with the same data for all entries or separate sigmas, and with a free lens if there is one."""
    measurement, pose, camera = make_measurement(kind, 1.0)
    poses = pose @ SE3.exp(0.03 * np.random.default_rng(0).standard_normal((3, 4, 6)))
    each = [measurement.noisier(1.0 + own * k) for k in range(3)]
    together = (stack(each) if own else measurement).linearise(poses, camera, camera is not None)
    for k, alone in enumerate(each):
        for part, expected in zip(together, alone.linearise(poses[k], camera, camera is not None), strict=True):
            np.testing.assert_allclose(part[k], expected, rtol=1e-9, atol=1e-10 * np.abs(expected).max())
    counts = (stack(each) if own else measurement).equations()
    np.testing.assert_array_equal(counts, np.stack([of.equations() for of in each]) if own else each[0].equations())


@pytest.mark.parametrize(("kind", "weight"), [("pixels", 1.0), ("points", 1000.0), ("pose", 1000.0)])
def test_default_sigmas_of_measurements(kind, weight):
    """The default sigma is a pixel, a millimetre and a milliradian for seen data, and the rest has no weight."""
    measurement, _, _ = make_measurement(kind, 0.0)
    seen = getattr(measurement, "seen", np.ones((4, 6)))
    unstated = replace(measurement, stated=np.zeros(measurement.stated.shape)).with_noise(Noise())
    np.testing.assert_allclose(unstated.weight, weight * seen)


@pytest.mark.parametrize("kind", ["pixels", "fisheye pixels"])
def test_lens_columns_are_the_slope_of_the_gradient(kind):
    """The information by the lens's parameters, each scaled to order one, is the slope of the gradient, too."""
    measurement, pose, camera = make_measurement(kind, 0.0)
    assert camera is not None
    scale = np.concatenate([np.ones(6), np.full(4, 100.0), np.ones(len(camera.distortion))])

    def gradient(xi: np.ndarray) -> np.ndarray:
        moved = camera.with_parameters(camera.parameters + (scale * xi)[6:])
        return scale * measurement.linearise(pose @ SE3.exp(xi[:6]), moved, True).gradient

    information = measurement.linearise(pose, camera, True).information * scale * scale[:, None]
    check_derivative(gradient, information, 3e-3, 1e-8)


@pytest.mark.parametrize("camera", [LENS, FISHEYE, Camera("pinhole", np.array([900.0, 900, 640, 360]))], ids=str)
@pytest.mark.parametrize(("distance", "offset", "flat"), [(0.9, 0.0, 1.0), (60.0, 0.0, 0.0), (9.0, 3.0, 1.0)])
def test_moments_equal_the_jacobian_result(camera, distance, offset, flat):
    """Gradient and information equal J'r and J'J to 1e-12 of their size.

    Targets are near, far, and with the origin off the points.
    """
    rng = np.random.default_rng(8)
    pose = facing_poses(rng, 20, distance)
    points = random_points(rng, offset) * [1, 1, flat]
    weight = random_weights(rng, 20, 7, 0.2)
    measurement = pixels_of(camera, pose, points, weight, 3 * rng.standard_normal((20, 7, 2)))
    by_moments = measurement.linearise(pose, camera, False)
    by_jacobian = measurement.linearise(pose, camera, True)
    np.testing.assert_allclose(by_moments.cost, by_jacobian.cost, rtol=1e-12)
    for few, all_ in (
        (by_moments.gradient, by_jacobian.gradient[:, :6]),
        (by_moments.information, by_jacobian.information[:, :6, :6]),
    ):
        size = np.abs(all_).reshape(20, -1).max(-1).reshape(20, *[1] * (all_.ndim - 1))
        np.testing.assert_allclose(few / size, all_ / size, rtol=0, atol=1e-12)


def test_chunking_of_views_has_no_effect():
    """Views at the limits of chunks have the same result alone."""
    rng = np.random.default_rng(1)
    pose, points = facing_poses(rng, 4000, 0.9), random_points(rng)
    measurement = pixels_of(LENS, pose, points, random_weights(rng, 4000, 7, 0.2), rng.standard_normal((4000, 7, 2)))
    whole = measurement.linearise(pose, LENS, False)
    some = np.array([0, 1027, 1028, 1029, 2056, 3999])
    alone = measurement.take(some).linearise(pose[some], LENS, False)
    for together, each in zip(whole, alone, strict=True):
        np.testing.assert_allclose(together[some], each, rtol=1e-10, atol=1e-9 * np.abs(each).max())


@pytest.mark.parametrize("common_px", [0.0, 0.5])
@pytest.mark.parametrize("free_lens", [False, True])
def test_seen_point_behind_the_camera_has_infinite_cost(free_lens, common_px):
    """A seen point behind the camera costs infinitely much, and an unseen one has no cost.

    Only its own view is lost, and gradients stay finite.
    """
    rng = np.random.default_rng(2)
    pose, points = facing_poses(rng, 3, 0.9), random_points(rng)
    points[0] = [0.0, 0.0, -3.0]
    pose = SE3(np.broadcast_to(np.eye(3), (3, 3, 3)).copy(), pose.translation)
    weight = np.full((3, 7), 5.0)
    weight[1:, 0] = 0.0
    measurement = PixelMeasurement(points, np.full((3, 7, 2), 300.0), weight > 0, weight, weight, common_px)
    view = measurement.linearise(pose, LENS, free_lens)
    without = replace(
        measurement,
        points_in_target=points[1:],
        pixels=measurement.pixels[:, 1:],
        seen=measurement.seen[:, 1:],
        stated=weight[:, 1:],
        weight=weight[:, 1:],
    ).linearise(pose, LENS, free_lens)
    assert np.isinf(view.cost[0])
    np.testing.assert_allclose(view.cost[1:], without.cost[1:], rtol=1e-12)
    np.testing.assert_allclose(view.information, without.information, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(view.gradient, without.gradient, rtol=1e-9, atol=1e-6)
    ahead = SE3(np.stack([pose.rotation] * 2), np.stack([pose.translation, pose.translation + np.array([0, 0, 4.0])]))
    cost = measurement.linearise(ahead, LENS, free_lens).cost
    assert np.isinf(cost).tolist() == [[True, False, False], [False, False, False]]


@pytest.mark.parametrize("free_lens", [False, True])
def test_shared_shift_equals_the_dense_covariance(free_lens):
    """Cost, gradient and information are r'V^-1 r, J'V^-1 r and J'V^-1 J with V = diag(sigma^2) + tau^2 11'."""
    measurement, pose, camera = make_measurement("pixels", 1.0)
    assert isinstance(measurement, PixelMeasurement)
    assert camera is not None
    common = 0.3
    ours = replace(measurement, common_px=common).linearise(pose, camera, free_lens)
    for view in range(len(pose)):
        seen = measurement.seen[view]
        points = replace(
            measurement, points_in_target=measurement.points_in_target[seen], pixels=measurement.pixels[:, seen]
        )
        residual = points.pixels[view] - camera.project(pose[view] @ points.points_in_target)
        covariance = np.diag(measurement.weight[view, seen] ** -2.0) + common**2
        cost = sum(r @ np.linalg.solve(covariance, r) for r in residual.T)
        assert ours.cost[view] == pytest.approx(cost, rel=1e-9)
    plain = measurement.linearise(pose, camera, free_lens)
    lost = plain.information - ours.information
    assert np.all(np.linalg.matrix_rank(lost, tol=1e-9 * np.abs(plain.information).max()) == 2)
    many = replace(measurement, common_px=1e-6).linearise(pose, camera, free_lens)
    for a, b in zip(many, plain, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9 * np.abs(b).max())


def test_shared_shift_keeps_the_gradient_of_the_cost():
    """With a shared shift the gradient is still half the derivative of the cost."""
    measurement, pose, camera = make_measurement("pixels", 1.0)
    assert isinstance(measurement, PixelMeasurement)
    shifted = replace(measurement, common_px=0.4)
    view = shifted.linearise(pose, camera, False)
    for k, step in enumerate(1e-6 * np.eye(6)):
        ahead, behind = (shifted.linearise(pose @ SE3.exp(s), camera, False).cost for s in (step, -step))
        np.testing.assert_allclose(view.gradient[:, k], (ahead - behind) / 4e-6, rtol=1e-4, atol=1e-3)


def test_empty_group_has_no_cost():
    """A group without views has no cost, gradients of its width, and no error."""
    made = simulate(Scenario(samples=3), 0)
    problem, _ = build_problem(made.cell, made.recording)
    nothing = problem.groups[0].take(np.zeros(0, dtype=np.int64))
    found = nothing.measurement.linearise(SE3.identity((0,)), made.cameras["wrist"], False)
    assert [part.shape for part in found] == [(0,), (0, 6), (0, 6, 6)]


def test_equations_are_limited_to_six_freedoms():
    """One point of an image gives two equations, three and a whole board six."""
    np.testing.assert_array_equal(limit_equations(2 * np.array([0, 1, 3, 4, 54])), [0, 2, 6, 6, 6])
