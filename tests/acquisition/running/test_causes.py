"""Causes of disagreement in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.drift.shifts import SIZE_KIND, Shift
from basecal.acquisition.running.causes import cause_of_error, cause_of_shifts
from basecal.effects.faces.effect import FoundEffect

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
        (shift("board", SIZE_KIND, None, [-0.04]), "board is another board since sample 12, 4 % smaller"),
    ],
)
def test_a_shift_is_named_with_its_size_and_sample(cause, words):
    """What moved, since when and by how much, once, and what to do."""
    assert cause_of_shifts([cause, cause], 12).startswith(f"{words}. Check what was bumped")


def test_an_error_of_all_samples_is_named():
    """A joint counts from 1; what only the report judges has no words."""
    size, covariance = np.radians([-0.3]), np.radians([[0.01]]) ** 2
    error = FoundEffect("joint_offsets", "joint-offset", "eye", False, False, None, "rad", size, covariance, size, 1)
    assert cause_of_error(error) == "Joint 2 of eye is off by -0.300 ± 0.010 deg. Check the zeros of the joints of eye."
    assert cause_of_error(replace(error, effect="bending")) is None


def test_a_frame_that_moved_has_a_short_name():
    """The last of its transform."""
    tangent = np.array([3e-3, 4e-3, 0, 0, 0, 0])
    error = FoundEffect(
        "step", "base-moved", "eye_base_from_hand_base", False, False, 12, "", tangent, 1e-8 * np.eye(6), tangent
    )
    assert cause_of_error(error).startswith("hand_base moved by 5.00 ± 0.10 mm")
