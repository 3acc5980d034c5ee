"""Tests of errors of focal lengths as a share."""

from __future__ import annotations

import numpy as np

from basecal.effects.focal_length import faulty_lens, typical_sigmas, words
from basecal.geometry import Camera

LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0]), None)


def test_usual_focal_length_error_is_two_per_mille():
    """The typical sigma of both focal lengths is 0.2 %."""
    np.testing.assert_allclose(typical_sigmas(LENS), [1.8, 1.82])


def test_focal_length_error_is_in_percent():
    """The error is the stated lens relative to the estimated one, with its sigma in the same unit."""
    assert (
        words(LENS, faulty_lens(0.01, LENS), np.full(4, 0.9)) == "fx is off by -1.00 ± 0.10 %, fy by -1.000 ± 0.099 %"
    )
