"""The lens of Kannala and Brandt."""

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
    """Images are OpenCV's, and their derivatives those of differences."""
    check_projection(fisheye, DISTORTION, points_before(rng, widest=1.5), cv2.fisheye.projectPoints)


def behind(rng):
    angle, turn = rng.uniform(1.6, 2.6, 20), rng.uniform(-3, 3, 20)
    return np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])


def test_derivative_past_a_right_angle(rng):
    """Points behind the lens have an image and its derivative as well."""
    points = behind(rng)
    _, _, d_points, _ = fisheye.project_with_derivatives(points, FOCAL, DISTORTION, False)
    check_derivative(
        lambda d: np.stack(fisheye.project(points + d, DISTORTION), -1) * FOCAL, d_points, step=3e-3, tolerance=1e-7
    )


def test_inverse(rng):
    """Every image inside the fold leads back to its point, behind the lens too."""
    check_inverse(fisheye, DISTORTION, points_before(rng, widest=2.0))
    check_inverse(fisheye, STRAIGHT, behind(rng))
    check_inverse(fisheye, [-0.05, 0.0, 0.0, 0.0], points_before(rng, widest=2.0))


def test_without_terms_the_image_is_the_angle():
    """The image lies at the angle from the axis, in the point's direction; right behind there is none."""
    points = np.array([[0.3, 0.4, 0.5], [-1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, -1.0]])
    u, v = fisheye.project(points, STRAIGHT)
    np.testing.assert_allclose([u[0], v[0]], np.pi / 4 * np.array([0.6, 0.8]))
    np.testing.assert_allclose([u[1], v[1]], [-np.pi / 2, 0.0], atol=1e-15)
    assert (u[2], v[2]) == (0.0, 0.0)
    assert np.isnan(u[3])


def test_fold_is_where_the_image_turns_back():
    """At the fold the distance from the centre has its first maximum; it is pi at most."""
    assert fisheye.fold(STRAIGHT) == np.pi
    # t (1 - t^2 / 3) turns back at t = 1.
    assert fisheye.fold([-1 / 3, 0.0, 0.0, 0.0]) == pytest.approx(1.0)
    for distortion in ([-0.2, 0.01, 0.0, 0.0], [-0.1, -0.02, 0.001, 0.0], [0.0, 0.0, -0.01, 0.0005], [0, 0, 0, -0.01]):
        t = fisheye.fold(distortion) * np.array([0.99, 1.0, 1.01])
        image, _ = fisheye.project(np.column_stack([np.sin(t), 0 * t, np.cos(t)]), distortion)
        assert image[1] > max(image[0], image[2])


def test_images_beyond_the_fold_have_no_direction():
    """What lies past the largest image is not valid, what lies short of it is; so for points."""
    barrel = [-1 / 3, 0.0, 0.0, 0.0]
    _, valid = fisheye.unproject(np.array([0.66, 0.67]), np.zeros(2), barrel)
    assert valid.tolist() == [True, False]
    t = np.array([0.99, 1.01])
    assert fisheye.domain_mask(np.column_stack([np.sin(t), 0 * t, np.cos(t)]), barrel).tolist() == [True, False]


def test_usual_distortion_is_slight(rng):
    """Lenses that simulations draw have four terms in their usual range."""
    drawn = np.array([fisheye.usual_distortion(rng) for _ in range(200)])
    spread = np.array([0.03, 0.01, 0.003, 0.001])
    assert drawn.shape == (200, fisheye.USUAL_TERMS)
    assert np.all(np.abs(drawn) <= spread)
    assert np.all(np.ptp(drawn, axis=0) > 1.5 * spread)


def test_every_term_has_a_name():
    """As many names as the longest distortion has terms; what is usual is allowed."""
    assert len(fisheye.TERM_NAMES) == max(fisheye.TERMS)
    assert fisheye.USUAL_TERMS in fisheye.TERMS


def test_the_centre_of_the_lens_has_no_image():
    """Nor has a point right behind it; the next ones beside and before it have."""
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [1e-9, 0.0, 0.0], [0.0, 0.0, 1e-9]])
    u, v = fisheye.project(points, DISTORTION)
    assert np.isnan(u).tolist() == np.isnan(v).tolist() == [True, True, False, False]


def test_lenses_that_are_drawn_are_nearly_equidistant(rng):
    """Four terms, uniform about none, each smaller than the one before."""
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
    """From next to the axis to a thousandth of the fold, where steps of Newton's method leave it."""
    fold = fisheye.fold(distortion)
    angle = fold * np.array([1e-9, 1e-3, 0.1, 0.5, 0.9, 0.99, 0.999])
    points = np.column_stack([0.6 * np.sin(angle), -0.8 * np.sin(angle), np.cos(angle)])
    found, valid = fisheye.unproject(*fisheye.project(points, distortion), distortion)
    assert valid.all()
    np.testing.assert_allclose(np.arctan2(np.hypot(*found[:, :2].T), found[:, 2]), angle, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-12)


@pytest.mark.parametrize("distortion", [DISTORTION, STRAIGHT, [-0.05, 0.0, 0.0, 0.0], [-0.2, 0.01, 0.0, 0.0]])
def test_directions_are_found_in_few_steps(monkeypatch, distortion):
    """Eight evaluations serve pixels up to nine tenths of the fold; those beyond it do not keep the others waiting."""
    calls, distance = [], fisheye._distance
    monkeypatch.setattr(fisheye, "_distance", lambda *given: calls.append(1) or distance(*given))
    wanted = distance(min(fisheye.fold(distortion), 2.0) * np.linspace(0, 0.9, 30), distortion)
    beyond = 1.5 * distance(np.array(fisheye.fold(distortion)), distortion)
    _, valid = fisheye.unproject(np.append(wanted, beyond), np.zeros(31), distortion)
    assert valid.tolist() == [True] * 30 + [False]
    assert len(calls) <= 9


def test_leading_axes_are_a_batch(rng):
    """Images and derivatives of each point are its own."""
    points = rng.uniform(-1, 1, (2, 3, 4, 3)) + np.array([0, 0, 2.0])
    whole = fisheye.project_with_derivatives(points, FOCAL, DISTORTION, True)
    flat = fisheye.project_with_derivatives(points.reshape(-1, 3), FOCAL, DISTORTION, True)
    assert whole.by_points.shape == (2, 3, 4, 2, 3)
    np.testing.assert_array_equal(whole.by_points.reshape(-1, 2, 3), flat.by_points)
    np.testing.assert_array_equal(whole.by_terms.reshape(-1, 2, 4), flat.by_terms)


def test_usual_lenses_show_most_of_a_half_space():
    """Across an image 1280 px wide, between 130 and 153 deg."""
    least, most = (np.degrees(1280 / focal) for focal in reversed(fisheye.USUAL_FOCAL_PX))
    assert 130 < least < most < 153
