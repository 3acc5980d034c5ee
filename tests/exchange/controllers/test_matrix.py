"""A homogeneous matrix."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.matrix import CONVENTION


def test_rows_follow_one_another():
    """A quarter turn about z, its shift at the end of each row."""
    read = CONVENTION.read(np.array([0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1.0]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0])
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])
