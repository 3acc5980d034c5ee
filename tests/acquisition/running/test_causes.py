"""Causes of disagreement in words."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.drift.shifts import SIZE, Shift
from basecal.acquisition.running.causes import cause_of_error, cause_of_shifts

TANGENT = np.array([3e-3, 4e-3, 0, 0, 0, np.radians(1)])


def shift(frame, transform, joint, size):
    return Shift(frame, transform, joint, np.asarray(size), np.zeros((0, 0)), np.zeros((0, 0)), 0.0, 0)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (
            shift("hand_base", "eye_base_from_hand_base", None, TANGENT),
            "hand_base moved at sample 12 by 5 mm and 1 deg",
        ),
        (shift("board", "f_from_board", None, TANGENT), "board was remounted or moved at sample 12 by 5 mm and 1 deg"),
        (shift("eye_flange", "", 1, np.radians([2])), "joint 2 of eye slipped by 2 deg at sample 12"),
        (shift("board", SIZE, None, [-0.04]), "board is another board since sample 12, 4 % smaller"),
    ],
)
def test_a_shift_is_named_with_its_size_and_sample(cause, words):
    """What moved, since when and by how much, once, and what to do."""
    assert cause_of_shifts([cause, cause], 12).startswith(f"{words}. Check what was bumped")


def test_an_error_of_all_samples_is_named():
    """A joint counts from 1; what only the report judges has no words."""
    error = SimpleNamespace(code="joint-offset", about="eye", since=None, joint=1, size=np.radians([-0.3]))
    assert cause_of_error(error).startswith("Joint 2 of eye is off by 0.3 deg.")
    error.code = "deflection"
    assert cause_of_error(error) is None
