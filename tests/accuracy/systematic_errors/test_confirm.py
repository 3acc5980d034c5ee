"""Held-out blocks: what is in all of them is confirmed, what chance put into one is not."""

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.candidates import Candidates
from basecal.accuracy.systematic_errors.confirm import confirmed
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.systematic_errors.table import length_scales
from basecal.cell import Recording, RobotState, Sample
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_packed
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def situation(factor):
    """Twenty-five samples of a hand whose lengths are off by a factor."""
    made = simulate(Scenario(samples=25, robot_noise=(1e-4, 1e-4)), 0)
    samples = []
    for sample in made.recording.samples:
        pose = sample.robots["hand"].base_from_flange
        read = SE3(pose.rotation, factor * pose.translation)
        samples.append(Sample(sample.sample, None, {**sample.robots, "hand": RobotState(read)}, sample.observations))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    return Situation(problem, solve_packed(problem, made.cell).state, problem, {})


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_lengths_that_are_off_predict_held_out_blocks(factor):
    """One per cent is confirmed, whichever way."""
    of = situation(factor)
    (scale,) = [c for c in length_scales(of) if c.about == ("hand",)]
    assert confirmed(of, scale)


def test_what_is_in_one_block_is_not_confirmed():
    """An error of a single view predicts no other."""
    of = situation(1.0)
    moves = np.zeros((25, 1, 6, 1))
    moves[7, 0, 0, 0] = 1.0
    assert not confirmed(of, Candidates("", ("hand",), (None,), "", (moves,)))
