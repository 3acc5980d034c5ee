"""What hangs on the joints of an arm."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.kinematics import Masses


def test_masses_are_copies():
    """Masses and their centres are read-only copies; nothing may hang on a joint."""
    kg = np.array([2.0, 0.0])
    masses = Masses(kg, np.ones((2, 3)))
    kg[0] = 5.0
    assert masses.kg.tolist() == [2.0, 0.0]
    assert not masses.centres.flags.writeable


@pytest.mark.parametrize(
    ("kg", "centres", "message"),
    [
        ([1.0, -1e-9], np.zeros((2, 3)), "not negative"),
        ([1.0, 1.0], np.zeros((3, 3)), r"centres has shape \(3, 3\), expected \(..., 2, 3\)"),
        ([1.0, 1.0], np.zeros((2, 2)), "centres has shape"),
        (np.ones(()), np.zeros((1, 3)), "kg has shape"),
    ],
)
def test_impossible_masses_are_refused(kg, centres, message):
    """A mass is not negative, and each has its centre."""
    with pytest.raises(InputError, match=message):
        Masses(kg, centres)


def test_down_is_a_direction():
    """Of any length, along -z unless it is told; no direction is refused."""
    one = np.ones(1), np.zeros((1, 3))
    assert Masses(*one).down.tolist() == [0.0, 0.0, -1.0]
    np.testing.assert_allclose(Masses(*one, np.array([3.0, 0.0, 4.0])).down, [0.6, 0.0, 0.8])
    with pytest.raises(InputError, match="direction of gravity"):
        Masses(*one, np.zeros(3))
