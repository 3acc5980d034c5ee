"""Errors of poses found from the corners of a flat target."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.estimation.view.pose_errors import corner_covariances, whitening_matrix
from basecal.geometry import SE3

FACING = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
POSES = SE3.stack(
    [
        SE3((FACING @ SE3.from_rotvec([tilt, 0, 0], [0, 0, 0])).rotation, [0.05, 0.0, distance])
        for tilt, distance in ((0.0, 0.4), (0.6, 0.4), (0.0, 0.8))
    ]
)
HALF_M = 0.04


def test_covariance_is_that_of_pnp() -> None:
    """Errors of `solvePnP` on corners of 0.1 px have it, within what 400 draws leave open."""
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


def test_tilt_is_worst_from_the_front() -> None:
    """Three times worse than aslant at ten times its half size, and four times worse at twice the distance."""
    tilt = np.sqrt(corner_covariances(POSES, HALF_M)[:, 3, 3])
    assert 3 < tilt[0] / tilt[1] < 10
    assert 3.5 < tilt[2] / tilt[0] < 4.5


def test_whitening_makes_views_equal() -> None:
    """Errors of each view become independent; rotations of all views together keep their size, as translations do."""
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
