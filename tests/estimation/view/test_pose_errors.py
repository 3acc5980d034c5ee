"""Tests of errors of poses from the corners of a flat target."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.estimation.view.pose_errors import CornerErrors, corner_covariances, whitening_matrix
from basecal.geometry import SE3

FACING = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
POSES = SE3.stack(
    [
        SE3((FACING @ SE3.from_rotvec([tilt, 0, 0], [0, 0, 0])).rotation, [0.05, 0.0, distance])
        for tilt, distance in ((0.0, 0.4), (0.6, 0.4), (0.0, 0.8))
    ]
)
HALF_M = 0.04


@pytest.mark.journey
def test_covariance_equals_that_of_pnp() -> None:
    """Errors of `solvePnP` with corners of 0.1 px have this covariance, within the uncertainty of 400 draws."""
    rng, focal = np.random.default_rng(0), 800.0
    lens = np.diag([focal, focal, 1.0])
    corners = HALF_M * np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    covariance = corner_covariances(POSES, HALF_M) * (0.1 / focal) ** 2
    for k in (1, 2):
        points = POSES[k] @ corners
        errors = []
        for _ in range(400):
            pixels = focal * points[:, :2] / points[:, 2:] + rng.normal(0, 0.1, (4, 2))
            start = cv2.Rodrigues(POSES[k].rotation)[0], POSES[k].translation[:, None].copy()
            turn, place = cv2.solvePnPRefineLM(corners, pixels, lens, None, *start)
            errors.append((POSES[k].inverse() @ SE3.from_rotvec(turn.ravel(), place.ravel())).log())
        whitened = np.array(errors) @ np.linalg.inv(np.linalg.cholesky(covariance[k])).T
        assert 0.8 < np.mean(whitened**2) < 1.25  # 2400 squares: three per cent of noise, and curvature of far views


def test_tilt_is_least_accurate_from_the_front() -> None:
    """Seen from the front at ten times its half size, tilt is three times worse than from the side.

    It is four times worse at twice the distance.
    """
    tilt = np.sqrt(corner_covariances(POSES, HALF_M)[:, 3, 3])
    assert 3 < tilt[0] / tilt[1] < 10
    assert 3.5 < tilt[2] / tilt[0] < 4.5


def test_whitening_makes_views_equal() -> None:
    """Errors of each view become independent.

    The overall size of rotations is unchanged, and so is that of translations.
    """
    covariance = corner_covariances(POSES, HALF_M)
    whitening = whitening_matrix(covariance)
    equal = whitening @ covariance @ whitening.mT
    for block in (slice(0, 3), slice(3, 6)):
        unit = equal[0, block, block][0, 0]
        np.testing.assert_allclose(
            equal[:, block, block], np.broadcast_to(unit * np.eye(3), (3, 3, 3)), atol=1e-6 * unit
        )
        assert abs(np.linalg.slogdet(whitening[:, block, block])[1].sum()) < 1e-9
    assert np.abs(equal[:, :3, 3:]).max() < 1e-6 * equal[:, 3, 3].max()


def test_differences_are_whitened_tangents() -> None:
    """Differences are whitened tangents to first order, and their derivative is that of the differences."""
    rng = np.random.default_rng(1)
    errors = CornerErrors.from_poses(POSES, HALF_M)
    tangents = 1e-6 * rng.normal(size=(3, 6))
    whitening = whitening_matrix(corner_covariances(POSES, HALF_M))
    moved = POSES @ SE3.exp(tangents)
    expected = (whitening @ tangents[..., None])[..., 0]
    np.testing.assert_allclose(
        errors.differences(POSES, moved), expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max()
    )
    far = POSES @ SE3.exp(0.1 * rng.normal(size=(3, 6)))
    step = 1e-6 * rng.normal(size=(3, 6))
    change = errors.differences(POSES, far @ SE3.exp(step)) - errors.differences(POSES, far @ SE3.exp(-step))
    np.testing.assert_allclose(change, 2 * (errors.jacobian(far) @ step[..., None])[..., 0], rtol=1e-4, atol=1e-11)


def test_oppositely_tilted_target_is_near() -> None:
    """Only perspective separates the two: far away they differ by at most a fifth of their tangent."""
    true, mirrored = (
        SE3.stack([SE3((FACING @ SE3.from_rotvec([tilt, 0, 0], [0, 0, 0])).rotation, [0.0, 0.0, 4.0])])
        for tilt in (0.1, -0.1)
    )
    whitening = whitening_matrix(corner_covariances(true, HALF_M))
    by_tangent = (whitening @ (mirrored.inverse() @ true).log()[..., None])[0, 3:, 0]
    by_corners = CornerErrors.from_poses(true, HALF_M).differences(mirrored, true)[0, 3:]
    assert np.linalg.norm(by_corners) < 0.2 * np.linalg.norm(by_tangent)


def test_rows_of_a_batch_are_selected() -> None:
    """Separate whitening matrices are selected by row, and a shared one is kept."""
    errors = CornerErrors.from_poses(POSES, HALF_M)
    assert errors.take_batch(np.array([0])).whitening is errors.whitening
    both = CornerErrors(HALF_M, np.stack([errors.whitening, 2 * errors.whitening]))
    np.testing.assert_array_equal(both.take_batch(np.array([1])).whitening, 2 * errors.whitening[None])
