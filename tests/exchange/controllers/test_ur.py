"""Universal Robots."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.ur import CONVENTION
from basecal.geometry import SE3


def test_the_example_of_the_script_manual():
    """`rotvec2rpy([3.14, 1.57, 0])` is given there as [-2.80856, -0.16202, 0.9]."""
    read = CONVENTION.read(np.array([0.1, 0.2, 0.3, 3.14, 1.57, 0]))
    np.testing.assert_allclose(read.rpy, [-2.80856, -0.16202, 0.9], atol=5e-6)
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])


def test_written_in_metres():
    """A shift of half a metre is 0.5."""
    np.testing.assert_allclose(CONVENTION.to_numbers(SE3.from_rpy([0, 0, 0], [0.5, 0, 0])), [0.5, 0, 0, 0, 0, 0])
