"""Points of a target and their ids."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.target import Target
from basecal.errors import InputError

TARGET = Target("points", np.array([2, 5, 9]), np.eye(3))


def test_points_are_found_by_their_ids():
    """In any order and more than once; an id that is not there is named with those that are."""
    assert TARGET.rows(np.array([9, 2, 9])).tolist() == [2, 0, 2]
    for unknown in (1, 3, 10):
        with pytest.raises(InputError, match=f"id {unknown} is not on the points, whose ids are 2 to 9"):
            TARGET.rows(np.array([2, unknown]))


def test_a_single_point_is_told_from_several():
    """One point has no rotation."""
    assert not TARGET.is_point
    assert Target("led", np.zeros(1), np.zeros((1, 3))).is_point


def test_points_are_copies():
    """Read-only, and of three numbers each."""
    points = np.eye(3)
    made = Target("points", np.arange(3), points)
    points[0, 0] = 7
    assert made.points[0, 0] == 1
    assert not made.ids.flags.writeable
    with pytest.raises(InputError, match="points_m has shape"):
        Target("points", np.arange(3), np.zeros((3, 2)))
