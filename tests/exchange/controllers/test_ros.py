"""ROS."""

from __future__ import annotations

import numpy as np

from basecal.exchange.controllers.ros import CONVENTION


def test_the_scalar_is_last():
    """A quarter turn about z, as `tf2_echo` prints it, in metres."""
    read = CONVENTION.read(np.array([0.1, 0.2, 0.3, 0, 0, 0.7071, 0.7071]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])
