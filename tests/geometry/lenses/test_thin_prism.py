"""Tests of OpenCV's thin prism model: projection, derivatives and inverse."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.cell.files import cell_from_dict, cell_to_dict
from basecal.estimation.solve import solve
from basecal.geometry import Array, Camera
from basecal.geometry.lenses import thin_prism
from basecal.simulation import Scenario, simulate
from derivatives import check_derivative
from lens_checks import check_inverse, check_projection, points_before

TERMS = [-0.2, 0.05, 1e-3, -2e-3, 0.02, 0.1, 0.02, 0.01, 4e-3, -2e-3, -3e-3, 1e-3]
CAMERA = Camera("pinhole", np.array([766.5, 765.4, 640.9, 358.8, *TERMS]), (1280, 720))


@pytest.fixture
def points() -> Array:
    return np.random.default_rng(7).uniform([-0.5, -0.3, 0.6], [0.5, 0.3, 1.4], (4, 25, 3))


def opencv_pixels(camera: Camera, points: Array) -> Array:
    fx, fy, cx, cy = camera.parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    pixels, _ = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, camera.distortion)
    return pixels.reshape(*points.shape[:-1], 2)


@pytest.mark.parametrize("only", [range(12), (8,), (9,), (10,), (11,)])
def test_pixels_equal_opencv(only: range, points: Array) -> None:
    """All terms together, and each of the prism's alone, agree with OpenCV to rounding."""
    terms = np.zeros(12)
    terms[list(only)] = np.array(TERMS)[list(only)]
    camera = CAMERA.with_parameters([*CAMERA.parameters[:4], *terms])
    np.testing.assert_allclose(camera.project(points), opencv_pixels(camera, points), rtol=0, atol=1e-9)


@pytest.mark.parametrize("distortion", [TERMS, [0.0] * 12, [0.0] * 8 + TERMS[8:]])
def test_derivatives_equal_finite_differences(distortion: list[float], points: Array) -> None:
    """Derivatives by points and by all sixteen parameters equal finite differences, at zero terms too."""
    camera = CAMERA.with_parameters([*CAMERA.parameters[:4], *distortion])
    pixels, d_points, d_parameters = camera.project_with_derivatives(points, intrinsics=True)
    assert d_parameters is not None
    assert d_parameters.shape == (4, 25, 2, 16)
    np.testing.assert_allclose(pixels, camera.project(points), rtol=0, atol=1e-11)
    check_derivative(lambda d: camera.project(points + d), d_points, step=5e-3)
    check_derivative(lambda d: camera.with_parameters(camera.parameters + d).project(points), d_parameters)


def test_zero_prism_equals_pinhole(points: Array) -> None:
    """With the last four terms zero, pixels and derivatives equal those of eight terms."""
    bare, plain = (CAMERA.with_parameters([*CAMERA.parameters[:12], *[0.0] * n]) for n in (4, 0))
    for ours, theirs in zip(bare.project_with_derivatives(points), plain.project_with_derivatives(points), strict=True):
        if ours is not None:
            np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=1e-12)


def test_undistort_is_the_inverse() -> None:
    """Nearly every pixel of the whole image has a direction that projects onto it."""
    pixels = np.stack(np.meshgrid(np.arange(0, 1280, 40.0), np.arange(0, 720, 40.0)), -1)
    rays, valid = CAMERA.undistort(pixels)
    assert valid.mean() > 0.95
    np.testing.assert_allclose(CAMERA.project(rays[valid]), pixels[valid], rtol=0, atol=1e-8)
    np.testing.assert_allclose(opencv_pixels(CAMERA, rays[valid]), pixels[valid], rtol=0, atol=1e-8)


def test_points_behind_the_lens_are_nan(points: Array) -> None:
    """A point behind the lens has no pixel and is not seen, and does not affect its neighbours."""
    points[0, 0, 2] = -1.0
    pixels, d_points, _ = CAMERA.project_with_derivatives(points)
    assert np.isnan(pixels[0, 0]).all()
    assert np.isnan(d_points[0, 0]).all()
    assert np.isfinite(pixels[1:]).all()
    assert not CAMERA.sees(points)[0, 0]


def test_batch_of_lenses_equals_separate_lenses(points: Array) -> None:
    """A batch of lenses projects and differentiates entry by entry as each lens alone."""
    scale = 1 + 0.01 * np.random.default_rng(0).standard_normal((4, 16))
    batch = CAMERA.with_parameters(CAMERA.parameters * scale)
    together = batch.project_with_derivatives(points, intrinsics=True)
    for k in range(4):
        for ours, theirs in zip(together, batch[k].project_with_derivatives(points[k], intrinsics=True), strict=True):
            assert ours is not None
            assert theirs is not None
            np.testing.assert_allclose(ours[k], theirs, rtol=1e-12, atol=1e-12)


def test_thin_prism_in_cell_yaml() -> None:
    """Twelve terms in a cell.yaml are read and written back, thirteen are refused."""
    lens = {"status": "fixed", "fx": 700.0, "fy": 700.0, "cx": 320.0, "cy": 240.0, "distortion": TERMS}
    data = {
        "schema": "basecal/cell/1",
        "reference": "eye",
        "robots": {"eye": {}},
        "cameras": {"wrist": {"on": "eye", "intrinsics": lens}},
    }
    cell = cell_from_dict(data)
    assert cell.cameras["wrist"].distortion_terms == 12
    assert cell_to_dict(cell)["cameras"]["wrist"]["intrinsics"] == lens
    lens["distortion"] = [*TERMS, 0.0]
    with pytest.raises(ValueError, match="8 or 12 terms"):
        cell_from_dict(data)


def test_calibration_estimates_prism_terms() -> None:
    """With a prior on the lens, a calibration improves the prism's terms over the prior, within the stated sigmas."""
    made = simulate(Scenario(camera=CAMERA, intrinsics="prior", samples=25, pixel_px=0.1), 3)
    solution = solve(made.cell, made.recording)
    columns = solution.problem.columns["wrist"]
    error = solution.state.cameras["wrist"].parameters - CAMERA.parameters
    sigma = np.sqrt(np.diag(solution.covariance[columns, columns]))
    assert len(error) == 16
    assert np.abs(error / sigma).max() < 4
    assert sigma[12:].max() < 0.7 * Scenario().intrinsics_prior[2]


def test_images_and_derivatives(rng: np.random.Generator) -> None:
    """On the plane at unit distance, images equal OpenCV's, and derivatives equal finite differences."""
    check_projection(thin_prism, TERMS, points_before(rng), cv2.projectPoints)


def test_unprojection_inverts_projection(rng: np.random.Generator) -> None:
    """Every image inside the fold is mapped back to its point, with a prism far stronger than any real lens's."""
    check_inverse(thin_prism, TERMS, points_before(rng))
    check_inverse(thin_prism, [*TERMS[:8], *(10 * np.array(TERMS[8:])).tolist()], points_before(rng))


def test_usual_distortion_is_a_pinhole_with_a_slight_prism(rng: np.random.Generator) -> None:
    """Twelve terms are drawn: five as a pinhole's, no rational ones, four of a prism in their usual range."""
    drawn = np.array([thin_prism.usual_distortion(rng) for _ in range(200)])
    spread = np.array([2e-3, 5e-4, 2e-3, 5e-4])
    assert drawn.shape == (200, thin_prism.USUAL_TERMS)
    np.testing.assert_array_equal(drawn[:, 5:8], 0.0)
    assert np.all(np.abs(drawn[:, 0] + 0.08) <= 0.05)
    assert np.all(np.abs(drawn[:, 8:]) <= spread)
    assert np.all(np.ptp(drawn[:, 8:], axis=0) > 1.5 * spread)


def test_drawn_lenses_are_pinholes_with_a_slight_prism(rng):
    """Rational terms are zero. The prism's first term of either axis is within 2e-3, the second within 5e-4."""
    drawn = np.array([thin_prism.usual_distortion(rng) for _ in range(2000)])
    assert drawn.shape == (2000, 12)
    assert not np.any(drawn[:, 5:8])
    half = np.array([2e-3, 5e-4, 2e-3, 5e-4])
    assert np.all(np.abs(drawn[:, 8:]) <= half)
    assert np.all(drawn[:, 8:].min(0) < -0.98 * half)
    assert np.all(drawn[:, 8:].max(0) > 0.98 * half)
    assert np.all((drawn[:, 0] < -0.02) & (drawn[:, 0] > -0.14))
