"""Tests of the pinhole lens of Brown and Conrady."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.geometry.lenses import pinhole
from lens_checks import check_inverse, check_projection, points_before

DISTORTIONS = {
    4: [-0.2, 0.05, 1e-3, -2e-3],
    5: [0.11, -0.03, 1.3e-3, 2e-3, 0.02],
    8: [0.4, 0.1, -1e-3, 5e-4, 0.02, 0.6, 0.2, 0.05],
}


@pytest.mark.parametrize("terms", DISTORTIONS)
def test_images_and_derivatives(terms, rng):
    """Images equal OpenCV's with four, five and eight terms, and derivatives equal finite differences."""
    check_projection(pinhole, DISTORTIONS[terms], points_before(rng), cv2.projectPoints)


@pytest.mark.parametrize("terms", DISTORTIONS)
def test_unprojection_inverts_projection(terms, rng):
    """Every image inside the fold is mapped back to its point."""
    check_inverse(pinhole, DISTORTIONS[terms], points_before(rng))


def test_projection_without_distortion(rng):
    """Without terms, or with zeros, the image is (x / z, y / z), with its derivative."""
    points = points_before(rng)
    for none in ([], [0.0] * 5):
        np.testing.assert_allclose(np.stack(pinhole.project(points, none), -1), points[:, :2] / points[:, 2:])
        u, v, d_points, _ = pinhole.project_with_derivatives(points, (2.0, 3.0), none, False)
        np.testing.assert_allclose(d_points[:, 0, 0], 2.0 / points[:, 2])
        np.testing.assert_allclose(d_points[:, 1, 1], 3.0 / points[:, 2])
        np.testing.assert_allclose(d_points[:, 0, 2], -2.0 * u / points[:, 2])
        np.testing.assert_allclose(d_points[:, 1, 2], -3.0 * v / points[:, 2])
        np.testing.assert_array_equal(d_points[:, [0, 1], [1, 0]], 0.0)
    assert pinhole.project_with_derivatives(points, (2.0, 3.0), [], True)[3].shape == (30, 2, 0)


def test_points_behind_the_camera_have_no_image():
    """At z <= 0, and only there, images and derivatives are NaN, and points are outside of the domain."""
    points = np.array([[0.1, 0.1, -1.0], [0.1, 0.1, 0.0], [0.1, 0.1, 1.0]])
    for distortion in ([], DISTORTIONS[5]):
        u, v, d_points, _ = pinhole.project_with_derivatives(points, (1.0, 1.0), distortion, False)
        for array in (u, v, d_points, pinhole.project(points, distortion)[0]):
            np.testing.assert_array_equal(np.isnan(array).reshape(3, -1).all(1), [True, True, False])
        assert pinhole.domain_mask(points, distortion).tolist() == [False, False, True]


def test_fold_is_the_first_maximum_of_the_image_radius():
    """The radius of the image has its first maximum at the fold, which is infinite without a maximum."""
    assert pinhole.fold([]) == float("inf")
    assert pinhole.fold([0.1, 0.1, 0.0, 0.0]) == float("inf")
    # r (1 - r^2 / 3) turns back at r = 1; a zero of the rational terms' denominator is a fold as well.
    assert pinhole.fold([-1 / 3, 0.0, 0.0, 0.0]) == pytest.approx(1.0)
    assert pinhole.fold([0, 0, 0, 0, 0, -0.25, 0, 0]) == pytest.approx(4.0)
    for terms, distortion in {8: [-0.3, 0.02, 0, 0, 0.001, 0.1, 0.01, 0.0], 5: [-0.35, 0.1, 0, 0, -0.02]}.items():
        edge = np.sqrt(pinhole.fold(distortion))
        r = edge * np.array([0.999, 1.0, 1.001])
        image, _ = pinhole.project(np.column_stack([r, 0 * r, 1 + 0 * r]), distortion)
        assert image[1] > max(image[0], image[2]), terms


def test_images_beyond_the_fold_are_invalid():
    """Pixels beyond the largest image are invalid, those short of it are valid."""
    _, valid = pinhole.unproject(np.array([0.66, 0.67]), np.zeros(2), [-1 / 3, 0.0, 0.0, 0.0])
    assert valid.tolist() == [True, False]


def test_usual_distortion_is_a_slight_barrel(rng):
    """Simulated lenses have five terms in their usual range, and no fold within 45 deg."""
    drawn = np.array([pinhole.usual_distortion(rng) for _ in range(200)])
    assert drawn.shape == (200, pinhole.USUAL_TERMS)
    middle, spread = np.array([-0.08, 0.02, 0, 0, 0]), np.array([0.05, 0.02, 1e-3, 1e-3, 0.005])
    assert np.all(np.abs(drawn - middle) <= spread)
    assert np.all(np.ptp(drawn, axis=0) > 1.5 * spread)
    assert all(pinhole.fold(each.tolist()) > 1.0 for each in drawn)


def test_every_term_has_a_name():
    """There are as many names as the longest distortion has terms, and the usual number is allowed."""
    assert len(pinhole.TERM_NAMES) == max(pinhole.TERMS)
    assert pinhole.USUAL_TERMS in pinhole.TERMS


def test_term_sigmas_match_real_lenses():
    """Tangential terms of sixteen cameras have an rms of 3.3e-3; k1 and k2 are unrestricted."""
    k1, k2, p1, p2, k3 = pinhole.TERM_SIGMAS
    assert k1 == k2 == np.inf
    assert p1 == p2 == pytest.approx(3.3e-3, rel=0.2)
    assert 0.05 < k3 < 0.2


def test_drawn_lenses_are_slight_barrels(rng):
    """Terms are uniform about k1 -0.08 and k2 0.02, within 0.05 and 0.02. Tangential terms are within 1e-3."""
    drawn = np.array([pinhole.usual_distortion(rng) for _ in range(2000)])
    middle, half = np.array([-0.08, 0.02, 0, 0, 0]), np.array([0.05, 0.02, 1e-3, 1e-3, 0.005])
    assert np.all(np.abs(drawn - middle) <= half)
    assert np.all(drawn.min(0) < middle - 0.98 * half)
    assert np.all(drawn.max(0) > middle + 0.98 * half)
