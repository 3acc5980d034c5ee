"""Franka."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange.controllers.franka import CONVENTION


def test_the_usual_start_of_its_examples():
    """At q = [0, -pi/4, 0, -3 pi/4, 0, pi/2, pi/4] with its hand, by its maker's DH parameters: it points down."""
    reported = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0.3069, 0, 0.4869, 1]
    read = CONVENTION.read(np.array(reported, dtype=float))
    np.testing.assert_allclose(read.translation, [0.3069, 0, 0.4869])
    np.testing.assert_allclose(read.rotation @ [0, 0, 1], [0, 0, -1])


def test_columns_follow_one_another():
    """A quarter turn about z: the first three numbers are where x goes."""
    read = CONVENTION.read(np.array([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1.0]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0])


def test_rows_instead_are_an_error():
    """A matrix written row by row has its shift where zeros must be."""
    with pytest.raises(InputError, match="last row"):
        CONVENTION.read(np.array([0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1.0]))
