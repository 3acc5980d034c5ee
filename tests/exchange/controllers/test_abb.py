"""ABB."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.abb import CONVENTION
from basecal.geometry import SE3


def test_the_example_of_the_reference_manual():
    """Data type `orient`, example 2: 30 deg about y are [0.965926, 0, 0.258819, 0]."""
    cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
    axes = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    written = CONVENTION.to_numbers(SE3(axes, np.array([0.1, 0, 0])))
    np.testing.assert_allclose(written, [100, 0, 0, 0.965926, 0, 0.258819, 0], atol=5e-7)
    np.testing.assert_allclose(CONVENTION.read(written).rotation, axes, atol=1e-12)
