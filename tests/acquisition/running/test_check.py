"""Tests of the running check of consecutive samples."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.drift.shifts import SIZE_KIND, Shift
from basecal.acquisition.running.check import RunningCheck, cause_of_error, cause_of_shifts
from basecal.acquisition.running.estimate import RunningEstimate
from basecal.effects.faces.effect import FoundEffect
from shared.running_samples import recorded, with_hand_base_moved, with_joint_off, with_views_of

TANGENT = np.array([3e-3, 4e-3, 0, 0, 0, np.radians(1)])


def reported(cell, samples):
    """Each doubt with the index of the sample after which it was reported."""
    check = RunningCheck(cell)
    return [(place, doubt) for place, sample in enumerate(samples) for doubt in check.add(sample)]


@pytest.mark.journey
def test_correct_samples_are_not_reported():
    """Correct samples cause no doubt."""
    assert reported(*recorded()) == []


def estimate_count():
    """Number of estimates in memory."""
    gc.collect()
    return sum(isinstance(each, RunningEstimate) for each in gc.get_objects())


@pytest.mark.journey
def test_old_estimates_are_not_kept():
    """Each holds all earlier samples: kept, they would fill the memory of a long capture."""
    cell, samples = recorded()
    before, check = estimate_count(), RunningCheck(cell)
    for sample in samples:
        check.add(sample)
    assert 1 <= estimate_count() - before <= 4


@pytest.mark.journey
def test_image_of_another_pose_is_reported():
    """The sample is reported at once with the advice to repeat it.

    The next sample shows that its image belongs to another pose.
    """
    cell, samples = recorded()
    (first, at_once), (second, later) = reported(cell, with_views_of(samples, 7, 6))
    assert (first, at_once.sample, at_once.repeats, at_once.is_lasting) == (7, 7, True, False)
    assert "image and its pose do not belong together" in at_once.message
    assert (second, later.sample, later.is_lasting) == (8, 7, False)
    assert later.message.startswith("The image of sample 7 does not belong to its pose.")


@pytest.mark.slow
def test_image_of_another_pose_does_not_change_the_estimate():
    """The sigma equals that of the other samples to 10 %."""
    cell, samples = recorded()
    wrong, without = RunningCheck(cell), RunningCheck(cell)
    for sample in with_views_of(samples, 7, 6):
        wrong.add(sample)
    for sample in (*samples[:7], *samples[8:]):
        without.add(sample)
    assert wrong.estimate.sigma == pytest.approx(without.estimate.sigma, rel=0.1)


@pytest.mark.journey
def test_moved_base_is_reported_with_its_sample():
    """The second sample after the motion shows what moved, and since when."""
    cell, samples = recorded()
    found = reported(cell, with_hand_base_moved(samples, 5e-3, start=7))
    assert [place for place, _ in found] == [7, 8]
    lasting = found[1][1]
    assert lasting.is_lasting
    assert lasting.sample == 7
    assert "hand_base moved at sample 7 by 5" in lasting.message


@pytest.mark.slow
def test_joint_offset_is_reported():
    """The robot is reported once, with the number of the joint and its offset."""
    cell, samples = recorded(20, joints=True)
    found = [doubt for _, doubt in reported(cell, with_joint_off(samples, "eye", 2, 5e-3)) if doubt.is_lasting]
    assert len(found) == 1
    assert found[0].message.startswith("Joint 3 of eye is off by -0.3")


@pytest.mark.journey
def test_offset_is_found_beside_unstated_noise():
    """Six samples show an offset of 0.3 deg for arms with unstated noise."""
    cell, samples = recorded(7, joints=True)
    (place, doubt), *_ = reported(cell, with_joint_off(samples, "eye", 2, 5e-3))
    assert (place, doubt.is_lasting) == (5, True)
    assert doubt.message.startswith("Joint 3 of eye is off by -0.2")


def shift(frame, transform, joint, size):
    return Shift(frame, transform, joint, np.asarray(size), np.zeros((0, 0)), np.zeros((0, 0)), 0.0, 0)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (
            shift("hand_base", "eye_base_from_hand_base", None, TANGENT),
            "hand_base moved at sample 12 by 5.0 mm and 1.0 deg",
        ),
        (
            shift("board", "f_from_board", None, TANGENT),
            "board was remounted or moved at sample 12 by 5.0 mm and 1.0 deg",
        ),
        (shift("eye_flange", "", 1, np.radians([2])), "joint 2 of eye slipped by 2.0 deg at sample 12"),
        (shift("board", SIZE_KIND, None, [-0.04]), "board is another target since sample 12, 4 % smaller"),
    ],
)
def test_shift_is_reported_with_its_size_and_sample(cause, words):
    """The moved body, its sample, its size and the advice are reported once."""
    assert cause_of_shifts([cause, cause], 12).startswith(f"{words}. Check what was bumped")


def test_error_of_all_samples_is_reported():
    """Joints count from 1; effects judged only by the report have no text."""
    size, covariance = np.radians([-0.3]), np.radians([[0.01]]) ** 2
    error = FoundEffect("joint_offsets", "joint-offset", "eye", False, False, None, "rad", size, covariance, size, 1)
    assert cause_of_error(error) == "Joint 2 of eye is off by -0.300 ± 0.010 deg. Check the zeros of the joints of eye."
    assert cause_of_error(replace(error, effect="bending")) is None


def test_moved_frame_has_a_short_name():
    """It is the last frame of its transform."""
    tangent = np.array([3e-3, 4e-3, 0, 0, 0, 0])
    error = FoundEffect(
        "step", "base-moved", "eye_base_from_hand_base", False, False, 12, "", tangent, 1e-8 * np.eye(6), tangent
    )
    assert cause_of_error(error).startswith("hand_base moved by 5.00 ± 0.10 mm")
