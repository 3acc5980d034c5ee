"""Every noise term, whichever are registered."""

from __future__ import annotations

from dataclasses import replace
from string import Formatter

import numpy as np
import pytest

from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.noise.terms.posture_at_stops import posture_at_stops
from basecal.estimation.noise.terms.term import noise_terms
from basecal.estimation.problem.build import build_problem
from basecal.registry import NOISE_TERMS
from basecal.simulation import Scenario, simulate

SIMULATED = simulate(Scenario(samples=12, joints=True), 1)
PROBLEM, _ = build_problem(SIMULATED.cell, SIMULATED.recording)


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_errors_are_of_the_stops(name):
    """Six rows for each stop of a robot, a column for each error; a unit of all turns the flange by a unit or a few."""
    errors = noise_terms()[name].errors(PROBLEM, "hand")
    assert errors.by_stop.shape == (len(stands(PROBLEM, "hand")[0]), 6, len(errors.is_turn))
    turned = errors.at_flange(np.ones(2))[3:]
    assert np.all((turned > 0.1) & (turned < 4))


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_a_robot_of_a_single_stop_has_nothing_in_common(name):
    """It shows none of what changes over its poses."""
    one = replace(SIMULATED.recording, samples=SIMULATED.recording.samples[:1])
    assert noise_terms()[name].errors(build_problem(SIMULATED.cell, one)[0], "hand") is None


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_words_name_figures_that_there_are(name):
    """What the registry says of a term can be filled in, and what is expected of its size is a factor and a spread."""
    term = noise_terms()[name]
    assert {field for _, field, _, _ in Formatter().parse(NOISE_TERMS[name]) if field} <= term.FIGURES.keys()
    assert term.EXPECTED.turn[0] > 0
    assert term.EXPECTED.turn[1] > 1


@pytest.mark.parametrize("name", NOISE_TERMS)
def test_errors_that_go_by_joints_are_the_same_at_any(name):
    """At the stops' own joints they are those of the stops; what goes by poses has none at joints."""
    term, at = noise_terms()[name], posture_at_stops(PROBLEM, "hand")
    found = term.at_posture(at)
    if not term.IS_LEFT:
        assert found is None
        return
    np.testing.assert_allclose(found.by_stop, term.errors(PROBLEM, "hand").by_stop, atol=1e-14)
