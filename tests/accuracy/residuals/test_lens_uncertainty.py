"""Tests of the uncertainty of a lens over its image."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.residuals.lens_uncertainty import lens_sigmas
from basecal.geometry import SE3, Camera

CAMERA = Camera("pinhole", np.array([900.0, 910.0, 630.0, 360.0, -0.1, 0.05, 1e-3, -1e-3, 0.01]), (1280, 720))
PIXELS = np.stack(np.meshgrid(np.linspace(0, 1279, 9), np.linspace(0, 719, 6)), -1).reshape(-1, 2)


@pytest.mark.journey
def test_lens_sigmas_match_drawn_lenses() -> None:
    """Lens sigmas match the scatter of rays imaged by drawn lenses, after the rotation that aligns them best."""
    rng = np.random.default_rng(0)
    sigmas = np.array([0.8, 0.7, 1.5, 1.2, 2e-3, 3e-3, 1e-4, 1e-4, 3e-3])
    rays, _ = CAMERA.undistort(PIXELS)
    squares = np.zeros(len(PIXELS))
    for _ in range(400):
        drawn = CAMERA.with_parameters(CAMERA.parameters + sigmas * rng.standard_normal(9))
        turn = np.zeros(3)
        for _ in range(3):
            moved = SE3.from_rotvec(turn, np.zeros(3)) @ rays
            off = drawn.project(moved) - PIXELS
            by_turn = drawn.project_with_derivatives(moved)[1] @ np.swapaxes(np.cross(np.eye(3), moved[:, None]), 1, 2)
            turn -= np.linalg.lstsq(by_turn.reshape(-1, 3), off.ravel(), rcond=None)[0]
        squares += np.sum(off**2, axis=-1) / 2 / 400
    np.testing.assert_allclose(lens_sigmas(CAMERA, np.diag(sigmas**2), PIXELS), np.sqrt(squares), rtol=0.12)


def test_shifted_centre_is_mostly_rotation() -> None:
    """A centre uncertain by 2 px is mostly compensated by a rotation, but not far from the axis."""
    camera = Camera("pinhole", np.array([900.0, 900.0, 639.5, 359.5]), (1280, 720))
    sigmas = lens_sigmas(camera, np.diag([0, 0, 4.0, 4.0]), PIXELS)
    assert sigmas.max() < 0.6
    assert lens_sigmas(camera, np.diag([4.0, 4.0, 0, 0]), PIXELS).max() > 0.8
