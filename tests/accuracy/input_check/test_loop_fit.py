"""How nearly loops can be closed, readings side by side."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.input_check.hypotheses import convention_hypotheses
from basecal.accuracy.input_check.loop_fit import ReadyViews, fit_loops, sight_for, trimmed
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


def test_views_are_made_ready_once_a_set_of_pixels():
    """Every reading gets the views that it would get alone; those that change only robots share their poses."""
    made = simulate(Scenario(samples=VIEWS, target="charuco"), 3)
    codes = {"robot-pose-inverted", "pairing-shifted", "length-unit"}
    readings = [r for r in convention_hypotheses(made.cell, made.recording) if r.code in codes]
    ready = ReadyViews(made.cameras)
    for reading in readings:
        problem, _ = build_problem(*reading.apply(made.cell, made.recording))
        (group,) = problem.groups
        view, alone = ready.of(group, 12), sight_for(group, made.cameras[group.camera], 12)
        np.testing.assert_array_equal(view.group.sample, alone.group.sample)
        np.testing.assert_array_equal(view.candidates.rotation, alone.candidates.rotation)
        for name in ("eye_base_from_eye_flange", "hand_base_from_hand_flange"):
            mine, theirs = getattr(view.group, name), getattr(alone.group, name)
            np.testing.assert_array_equal(mine.translation, theirs.translation)
    assert len(ready.known) < len(readings) / 2


def test_trimmed_counts_what_is_not_finite_as_the_largest():
    """Of ten values seven count; where more than three are lost nothing is left to go by."""
    off = np.array([3.0, 4.0, 3.0, 4.0, 3.0, 4.0, 5.0, np.nan, np.inf, 99.0])
    assert trimmed(off) == pytest.approx(np.sqrt(np.mean(off[:7] ** 2)))
    assert trimmed(np.append(off, [np.nan] * 4)) == np.inf
    assert trimmed(np.zeros(0)) == np.inf
