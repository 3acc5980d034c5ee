"""The principal point by pixels."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.principal_point import faulty_lens, typical_sigmas, words
from basecal.geometry import Camera

LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0]), None)


@pytest.mark.parametrize(("size_px", "sigma"), [((1300, 720), 1.3), (None, 1.28)])
def test_a_usual_calibration_is_off_by_a_thousandth_of_the_width(size_px, sigma):
    """Which is twice cx if it is not stated."""
    np.testing.assert_allclose(typical_sigmas(Camera("pinhole", LENS.parameters, size_px)), sigma)


def test_pixels_of_both_coordinates():
    """The stated lens less the estimated one."""
    assert words(LENS, faulty_lens(np.sqrt(2), LENS), np.full(4, 0.1)) == "cx by -1.00 ± 0.10 px, cy by -1.00 ± 0.10 px"
