"""Tests of steps and drifts of frames over time."""

from __future__ import annotations

import numpy as np

from basecal.effects.drift import candidates as drifts
from basecal.effects.step import candidates as steps
from basecal.simulation import Scenario
from made_views import Made, views_of


def test_steps_and_drifts_move_dependent_views_only():
    """A step moves a dependent view from its sample on, a drift by its share of the time; other views have no moves."""
    of = Made(6, {}, {"base": None, "sample": np.arange(3)}, times=np.array([0.0, 1.0, 2.0, 3.0, 4.0, 8.0]))
    (step,), (drift,) = steps(of), drifts(of)
    assert (step.moves[1], drift.moves[1]) == (None, None)
    moved = of.frame_jacobian(0, "base")
    np.testing.assert_array_equal(step.moves[0][:, 0], moved * (np.arange(6) >= 3)[:, None, None])
    share = np.array([0, 0.125, 0.25, 0.375, 0.5, 1.0])
    np.testing.assert_allclose(drift.moves[0][:, 0], share[:, None, None] * moved)
    assert list(drifts(Made(5))) == []


def test_steps_and_drifts_follow_time():
    """A step moves nothing before its sample and everything after.

    A drift moves the last sample like a step, and not the first.
    """
    of = views_of(Scenario(samples=12))
    for name in of.frames:
        frame = of.frame_jacobian(0, name)
        drift = next(c for c in drifts(of) if c.about[0] == name)
        candidates = next(c for c in steps(of) if c.about[0] == name)
        for b, since in enumerate(candidates.since):
            np.testing.assert_allclose(candidates.moves[0][:since, b], 0)
            np.testing.assert_allclose(candidates.moves[0][since:, b], frame[since:])
        np.testing.assert_allclose(drift.moves[0][:, 0][[0, -1]], frame[[0, -1]] * np.array([0, 1])[:, None, None])
