"""Tests of a clock's drift, an offset that grows over the recording."""

from __future__ import annotations

import numpy as np
import pytest
from tests.accuracy.systematic_errors.test_search import record_path

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.effects.clock_drift import candidates as clock_drifts
from basecal.effects.clock_offset import candidates as clock_offsets
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.simulation import Scenario, simulate
from made_views import Made


def test_clock_drift_is_zero_in_middle():
    """A drift is half the offset at the last sample, minus half at the first; without stamps there is none."""
    made = simulate(Scenario(samples=1, layout="eye_to_hand", target="pose"), 0)
    cell, recording = record_path(0.0)
    problem, _ = build_problem(cell, recording)
    of = Situation(
        problem,
        State(made.truth, made.cameras, np.zeros((0, 6))),
        problem,
        {s.sample: s.stamp_s for s in recording.samples},
    )
    (offset,), (drift,) = clock_offsets(of), clock_drifts(of)
    share = np.linspace(-0.5, 0.5, 50)[of.sample_indices(problem.groups[0])]
    np.testing.assert_allclose(drift.moves[0], share[:, None, None, None] * offset.moves[0], atol=1e-12)
    assert not list(clock_drifts(Situation(problem, of.state, problem, {})))


@pytest.mark.parametrize(("count", "timed", "is_candidate"), [(6, True, True), (5, True, False), (6, False, False)])
def test_clock_drift_needs_six_timed_samples(count, timed, is_candidate):
    """Drifts are candidates from six stamped samples on, from minus half to plus half of the offset."""
    of = Made(count, has_times=timed)
    found = list(clock_drifts(of))
    assert [(each.code, each.about, each.unit) for each in found] == (
        [("clock-drift", ("wrist",), "s")] if is_candidate else []
    )
    if is_candidate:
        (offset,) = clock_offsets(of)
        share = np.linspace(-0.5, 0.5, count)[:, None, None, None]
        np.testing.assert_allclose(found[0].moves[0], share * offset.moves[0], atol=1e-12)
