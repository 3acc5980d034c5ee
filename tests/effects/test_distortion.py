"""Tests of distortion, measured by the shift of the farthest image corner."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.distortion import farthest_corner, faulty_lens, typical_sigmas
from basecal.geometry import Camera

PINHOLE = np.array([900.0, 910.0, 640.0, 360.0, -0.1, 0.05, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("camera", [
    Camera("pinhole", PINHOLE, (1280, 720)), Camera("fisheye", PINHOLE[:8], (1280, 720)),
])  # fmt: skip
def test_each_distortion_term_moves_corner_equally(camera):
    """One sigma of each term moves the farthest corner by a thousandth of the image width."""
    plain = camera.with_parameters(np.append(camera.parameters[:4], np.zeros(len(camera.distortion))))
    corner = np.array([640 / 900, 360 / 910, 1.0])
    np.testing.assert_allclose(farthest_corner(camera), corner)
    for k, term in enumerate(typical_sigmas(camera), start=4):
        bent = plain.with_parameters(plain.parameters + 1e-3 * term * np.eye(len(plain.parameters))[k])
        assert np.linalg.norm(bent.project(corner) - plain.project(corner)) == pytest.approx(1.28e-3, rel=0.01)


def test_lens_without_terms_has_no_distortion_error():
    """A lens without distortion terms is unchanged."""
    plain = Camera("pinhole", PINHOLE[:4], None)
    assert len(typical_sigmas(plain)) == 0
    np.testing.assert_array_equal(faulty_lens(3.0, plain).parameters, plain.parameters)


def test_farthest_corner_is_inside_image():
    """The farthest corner may be on either side. An image of unknown size extends to twice the principal point."""
    for size, corner in (((1280, 720), [640, 360]), ((1400, 700), [760, 360]), ((1000, 800), [640, 440])):
        ray = farthest_corner(Camera("pinhole", PINHOLE, size))
        np.testing.assert_allclose(ray, [corner[0] / 900, corner[1] / 910, 1])
    unsized = Camera("pinhole", PINHOLE, None)
    np.testing.assert_allclose(farthest_corner(unsized), [640 / 900, 360 / 910, 1])
    np.testing.assert_allclose(typical_sigmas(unsized), typical_sigmas(Camera("pinhole", PINHOLE, (1280, 720))))
    wide = Camera("pinhole", PINHOLE, (2560, 720))
    near, far = np.hypot(640 / 900, 360 / 910), np.hypot(1920 / 900, 360 / 910)
    ratio = typical_sigmas(wide)[0] / typical_sigmas(unsized)[0]
    assert ratio == pytest.approx(2 * (near / far) ** 3, rel=0.01)
