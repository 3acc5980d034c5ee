"""How nearly loops can be closed, readings side by side."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.input_check.hypotheses import convention_hypotheses
from basecal.accuracy.input_check.loop_fit import fit_loops, sight_for, trimmed
from basecal.estimation.problem.build import build_problem
from basecal.simulation import Scenario, simulate

VIEWS = 20


def pairs_of(made, told):
    problem, _ = build_problem(*told)
    return [(sight_for(g, made.cameras.get(g.camera), VIEWS), problem) for g in problem.groups]


@pytest.mark.parametrize("target", ["charuco", "pose", "led"])
def test_readings_do_not_know_of_one_another(target):
    """Fits of all readings at once are those of each alone, and only the declared one closes its loops."""
    mounts = "fixed" if target == "led" else "free"
    made = simulate(Scenario(samples=VIEWS, target=target, camera_mount=mounts, target_mount=mounts), 3)
    readings = [r for r in convention_hypotheses(made.cell, made.recording) if r.code == "robot-pose-inverted"]
    told = [(made.cell, made.recording), *(r.apply(made.cell, made.recording) for r in readings)]
    pairs = [pair for each in told for pair in pairs_of(made, each)]
    together = fit_loops(pairs)
    for pair, fit in zip(pairs, together, strict=True):
        (alone,) = fit_loops([pair])
        np.testing.assert_allclose(fit.off, alone.off, rtol=1e-6, atol=1e-9)
    scores = [trimmed(fit.off) for fit in together]
    assert len(scores) == 4
    assert scores[0] < 0.01
    assert min(scores[1:]) > 0.05


def test_trimmed_counts_what_is_not_finite_as_the_largest():
    """Of ten values seven count; where more than three are lost nothing is left to go by."""
    off = np.array([3.0, 4.0, 3.0, 4.0, 3.0, 4.0, 5.0, np.nan, np.inf, 99.0])
    assert trimmed(off) == pytest.approx(np.sqrt(np.mean(off[:7] ** 2)))
    assert trimmed(np.append(off, [np.nan] * 4)) == np.inf
    assert trimmed(np.zeros(0)) == np.inf
