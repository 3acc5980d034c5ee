"""Tests of errors of the principal point in pixels."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.principal_point import faulty_lens, typical_sigmas, words
from basecal.geometry import Camera

LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0]), None)


@pytest.mark.parametrize(("size_px", "sigma"), [((1300, 720), 1.3), (None, 1.28)])
def test_usual_principal_point_error_is_thousandth_of_width(size_px, sigma):
    """The width is twice cx if it is not stated."""
    np.testing.assert_allclose(typical_sigmas(Camera("pinhole", LENS.parameters, size_px)), sigma)


def test_principal_point_error_is_stated_minus_estimated():
    """The message has both coordinates in pixels, stated lens minus estimated lens."""
    assert words(LENS, faulty_lens(np.sqrt(2), LENS), np.full(4, 0.1)) == "cx by -1.00 ± 0.10 px, cy by -1.00 ± 0.10 px"
