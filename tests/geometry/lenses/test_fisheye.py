"""Tests of the fisheye lens of Kannala and Brandt."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.geometry.lenses import fisheye
from derivatives import check_derivative
from lens_checks import FOCAL, check_inverse, check_projection, points_before

DISTORTION = [0.08, -0.01, 0.004, -0.001]
STRAIGHT = [0.0] * 4


def test_images_and_derivatives(rng):
    """Images equal OpenCV's, and derivatives equal finite differences."""
    check_projection(fisheye, DISTORTION, points_before(rng, widest=1.5), cv2.fisheye.projectPoints)


def points_behind(rng):
    angle, turn = rng.uniform(1.6, 2.6, 20), rng.uniform(-3, 3, 20)
    return np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def test_derivative_beyond_a_right_angle(rng):
    """Points behind the lens have an image and a derivative, too."""
    points = points_behind(rng)
    _, _, d_points, _ = fisheye.project_with_derivatives(points, FOCAL, DISTORTION, False)
    check_derivative(
        lambda d: np.stack(fisheye.project(points + d, DISTORTION), -1) * FOCAL, d_points, step=3e-3, tolerance=1e-7
    )


def test_unprojection_inverts_projection(rng):
    """Every image inside the fold is mapped back to its point, behind the lens too."""
    check_inverse(fisheye, DISTORTION, points_before(rng, widest=2.0))
    check_inverse(fisheye, STRAIGHT, points_behind(rng))
    check_inverse(fisheye, [-0.05, 0.0, 0.0, 0.0], points_before(rng, widest=2.0))


def test_image_without_distortion_is_the_angle():
    """The image is at the angle from the axis, in the point's direction. A point exactly behind has none."""
    points = np.array([[0.3, 0.4, 0.5], [-1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, -1.0]])
    u, v = fisheye.project(points, STRAIGHT)
    np.testing.assert_allclose([u[0], v[0]], np.pi / 4 * np.array([0.6, 0.8]))
    np.testing.assert_allclose([u[1], v[1]], [-np.pi / 2, 0.0], atol=1e-15)
    assert (u[2], v[2]) == (0.0, 0.0)
    assert np.isnan(u[3])


def test_fold_is_the_first_maximum_of_the_image_radius():
    """The distance from the centre has its first maximum at the fold, which is at most pi."""
    assert fisheye.fold(STRAIGHT) == np.pi
    # t (1 - t^2 / 3) turns back at t = 1.
    assert fisheye.fold([-1 / 3, 0.0, 0.0, 0.0]) == pytest.approx(1.0)
    for distortion in ([-0.2, 0.01, 0.0, 0.0], [-0.1, -0.02, 0.001, 0.0], [0.0, 0.0, -0.01, 0.0005], [0, 0, 0, -0.01]):
        t = fisheye.fold(distortion) * np.array([0.99, 1.0, 1.01])
        image, _ = fisheye.project(np.column_stack([np.sin(t), 0 * t, np.cos(t)]), distortion)
        assert image[1] > max(image[0], image[2])


def test_images_beyond_the_fold_are_invalid():
    """Pixels and points beyond the largest image are invalid, those short of it are valid."""
    barrel = [-1 / 3, 0.0, 0.0, 0.0]
    _, valid = fisheye.unproject(np.array([0.66, 0.67]), np.zeros(2), barrel)
    assert valid.tolist() == [True, False]
    t = np.array([0.99, 1.01])
    assert fisheye.domain_mask(np.column_stack([np.sin(t), 0 * t, np.cos(t)]), barrel).tolist() == [True, False]


def test_usual_distortion_is_slight(rng):
    """Simulated lenses have four terms in their usual range."""
    drawn = np.array([fisheye.usual_distortion(rng) for _ in range(200)])
    spread = np.array([0.03, 0.01, 0.003, 0.001])
    assert drawn.shape == (200, fisheye.USUAL_TERMS)
    assert np.all(np.abs(drawn) <= spread)
    assert np.all(np.ptp(drawn, axis=0) > 1.5 * spread)


def test_every_term_has_a_name():
    """There are as many names as the longest distortion has terms, and the usual number is allowed."""
    assert len(fisheye.TERM_NAMES) == max(fisheye.TERMS)
    assert fisheye.USUAL_TERMS in fisheye.TERMS


def test_centre_of_the_lens_has_no_image():
    """The centre and a point exactly behind it have no image, but points just beside and in front do."""
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [1e-9, 0.0, 0.0], [0.0, 0.0, 1e-9]])
    u, v = fisheye.project(points, DISTORTION)
    assert np.isnan(u).tolist() == np.isnan(v).tolist() == [True, True, False, False]


def test_drawn_lenses_are_nearly_equidistant(rng):
    """Four terms are drawn uniformly about zero, each with a smaller range than the one before."""
    drawn = np.array([fisheye.usual_distortion(rng) for _ in range(2000)])
    half = np.array([0.03, 0.01, 0.003, 0.001])
    assert np.all(np.abs(drawn) <= half)
    assert np.all(drawn.min(0) < -0.98 * half)
    assert np.all(drawn.max(0) > 0.98 * half)


@pytest.mark.parametrize(
    "distortion",
    [
        [-1 / 3, 0.0, 0.0, 0.0],
        [-0.2, 0.01, 0.0, 0.0],
        [0.0, 0.0, -0.01, 0.0005],
        [0.5, 0.2, 0.1, 0.05],
        [0.0, 0.0, 0.0, -0.01],
        [-0.3, 0.05, -0.004, 0.0],
    ],
)
def test_directions_are_exact_up_to_the_fold(distortion):
    """Directions are exact from near the axis to 0.999 of the fold, where Newton steps leave it."""
    fold = fisheye.fold(distortion)
    angle = fold * np.array([1e-9, 1e-3, 0.1, 0.5, 0.9, 0.99, 0.999])
    points = np.column_stack([0.6 * np.sin(angle), -0.8 * np.sin(angle), np.cos(angle)])
    found, valid = fisheye.unproject(*fisheye.project(points, distortion), distortion)
    assert valid.all()
    np.testing.assert_allclose(np.arctan2(np.hypot(*found[:, :2].T), found[:, 2]), angle, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-12)


@pytest.mark.parametrize("distortion", [DISTORTION, STRAIGHT, [-0.05, 0.0, 0.0, 0.0], [-0.2, 0.01, 0.0, 0.0]])
def test_directions_are_found_in_few_steps(monkeypatch, distortion):
    """Eight evaluations suffice for pixels up to 0.9 of the fold, and pixels beyond it do not delay the others."""
    calls, distance = [], fisheye._distance
    monkeypatch.setattr(fisheye, "_distance", lambda *given: calls.append(1) or distance(*given))
    wanted = distance(min(fisheye.fold(distortion), 2.0) * np.linspace(0, 0.9, 30), distortion)
    beyond = 1.5 * distance(np.array(fisheye.fold(distortion)), distortion)
    _, valid = fisheye.unproject(np.append(wanted, beyond), np.zeros(31), distortion)
    assert valid.tolist() == [True] * 30 + [False]
    assert len(calls) <= 9


def test_leading_axes_are_a_batch(rng):
    """Images and derivatives of each point are the same in a batch of any shape."""
    points = rng.uniform(-1, 1, (2, 3, 4, 3)) + np.array([0, 0, 2.0])
    whole = fisheye.project_with_derivatives(points, FOCAL, DISTORTION, True)
    flat = fisheye.project_with_derivatives(points.reshape(-1, 3), FOCAL, DISTORTION, True)
    assert whole.by_points.shape == (2, 3, 4, 2, 3)
    np.testing.assert_array_equal(whole.by_points.reshape(-1, 2, 3), flat.by_points)
    np.testing.assert_array_equal(whole.by_terms.reshape(-1, 2, 4), flat.by_terms)


def test_usual_fisheye_field_of_view():
    """An image 1280 px wide shows between 130 and 153 deg."""
    least, most = (np.degrees(1280 / focal) for focal in reversed(fisheye.USUAL_FOCAL_PX))
    assert 130 < least < most < 153
