"""Which samples close the loop with one another."""

from __future__ import annotations

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.cell import Unknown
from basecal.estimation.outliers.agreeing_samples import _split_at_gap, agreeing_samples
from basecal.geometry import SE3

SIGMA = np.full(6, 1e-4)


def agreeing(misfits):
    """Samples said to agree, of those that are off by so many sigmas in every number, at the true state."""
    known = Unknown("prior", SE3.identity(), np.full(6, 1e-9))
    problem, state = pose_problem(np.outer(misfits, SIGMA), SIGMA, known)
    return agreeing_samples(problem, [state])


@pytest.mark.parametrize(("count", "found"), [(5, False), (6, True), (10, True), (16, True), (17, False)])
def test_between_three_and_eight_tenths_agree(count, found):
    """Of twenty samples 6 to 16 that stand clear of the rest are told; fewer may be chance, more need no telling."""
    misfits = np.where(np.arange(20) < count, 1.0, 50.0)
    assert agreeing(misfits) == (tuple(range(count)) if found else ())


@pytest.mark.parametrize(("gap", "found"), [(4.9, False), (5.1, True)])
def test_the_rest_is_five_times_further_off(gap, found):
    """Without a gap of a factor of five no samples stand clear."""
    misfits = np.where(np.arange(20) < 10, 2.0, 2.0 * gap)
    assert agreeing(misfits) == (tuple(range(10)) if found else ())


def test_within_the_noise_there_is_no_gap():
    """Misfits below one sigma count as one sigma."""
    assert agreeing(np.where(np.arange(20) < 10, 0.01, 4.9)) == ()
    assert agreeing(np.where(np.arange(20) < 10, 0.01, 5.1)) == tuple(range(10))


def test_the_state_that_explains_most_counts():
    """Of two states with a gap the one whose agreeing samples fit better is taken; without a state there are none."""
    known = Unknown("prior", SE3.identity(), np.full(6, 1e-9))
    problem, state = pose_problem(np.outer(np.where(np.arange(20) < 10, 2.0, 50.0), SIGMA), SIGMA, known)
    other = {**state.transforms, MOUNT: SE3.exp(-1.001 * 50 * SIGMA)}
    shifted = type(state)(other, {}, state.stop_errors)
    assert agreeing_samples(problem, [shifted]) == tuple(range(10, 20))
    assert agreeing_samples(problem, [state, shifted]) == tuple(range(10, 20))
    assert agreeing_samples(problem, []) == ()


def test_samples_part_at_the_first_clear_gap():
    """The largest misfit before it, and the numbers up to there, rising."""
    numbers = np.array([7, 3, 9, 1, 5, 8, 2, 4, 6, 0])
    sigmas = np.array([2.0, 1.5, 60.0, 1.7, 3.0, 70.0, 20.0, 4e18, 1.2, np.inf])
    assert _split_at_gap(numbers, sigmas) == (3.0, (1, 3, 5, 6, 7))
    assert _split_at_gap(numbers, np.where(sigmas < 10, 0.1, 5.1)) == (1.0, (1, 3, 5, 6, 7))
    assert _split_at_gap(numbers, np.where(sigmas < 10, 1e15, 1e30)) == (np.inf, ())
