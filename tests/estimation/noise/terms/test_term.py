"""Every noise term, whichever are registered."""

from __future__ import annotations

from dataclasses import replace
from string import Formatter

import numpy as np
import pytest

from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.noise.terms.term import noise_terms
from basecal.estimation.problem.build import build_problem
from basecal.registry import NOISE_TERMS
from basecal.simulation import Scenario, simulate

SIMULATED = simulate(Scenario(samples=12), 1)
PROBLEM, _ = build_problem(SIMULATED.cell, SIMULATED.recording)


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_modes_are_of_the_stops(name):
    """A row for each stop of a robot, finite; what they all show is of the size of a unit error, at most twice it."""
    modes = noise_terms()[name].modes(PROBLEM, "hand")
    assert len(modes) == len(stands(PROBLEM, "hand")[0])
    assert modes.shape[1] > 0
    assert 0.1 < np.sqrt(np.mean(np.sum(modes**2, axis=1))) < 2


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_a_robot_of_a_single_stop_has_nothing_in_common(name):
    """No modes, one row."""
    one = replace(SIMULATED.recording, samples=SIMULATED.recording.samples[:1])
    assert noise_terms()[name].modes(build_problem(SIMULATED.cell, one)[0], "hand").shape == (1, 0)


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_words_name_figures_that_there_are(name):
    """What the registry says of a term can be filled in, and what is expected of its size is a factor and a spread."""
    term = noise_terms()[name]
    assert {field for _, field, _, _ in Formatter().parse(NOISE_TERMS[name]) if field} <= term.FIGURES.keys()
    assert term.OVER_STOP[0] > 0
    assert term.OVER_STOP[1] > 1
