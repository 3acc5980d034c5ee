"""OpenCV's methods on the folds of the answer."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.opencv_rivals import opencv_rivals
from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.cell import Rival
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def rivals_of(**options: object) -> tuple[Rival, ...]:
    made = simulate(Scenario(samples=15, robot_noise=(2e-4, 5e-4), **options), 1)
    solution = solve(made.cell, made.recording)
    split = next(splits(solution.problem))
    return opencv_rivals(solution, refit_folds(solution.problem, solution.state, split.folds, 50))


def test_one_arm_has_seven_rivals() -> None:
    """Each predicts held-out views, none much better than the answer, all to within what hand-eye methods reach."""
    ours, *others = rivals_of(layout="eye_in_hand")
    assert ours.name == "basecal"
    assert len(others) == 7
    assert all(0.8 * ours.target_m < other.target_m < 0.05 for other in others)
    assert all(np.isfinite(other.target_rad) for other in others)


def test_two_moving_arms_have_none() -> None:
    """No method of OpenCV takes two arms of which both move in every view."""
    assert rivals_of(layout="dual") == ()
