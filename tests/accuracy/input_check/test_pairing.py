"""Where the pairing slips, and which views of a grid are upside down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.input_check import pairing, rewriting
from basecal.accuracy.input_check.loop_fit import trimmed
from basecal.accuracy.input_check.pairing import half_turns, pairing_errors
from basecal.cell import Recording
from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.problem.correspondence import half_turn
from basecal.simulation import Scenario, simulate


def test_the_sample_of_a_missed_detection_is_found():
    """Observations from sample 9 on one too early: the first guess moves them back from there."""
    made = simulate(Scenario(samples=24), 3)
    wrong = rewriting.shifted(made.recording, None, -1, start=9)
    first, fits = pairing_errors(made.cell, wrong, made.cameras, [None, "eye", "hand"])[0]
    told = first.apply(made.cell, wrong)[1]
    true = {s.sample: s.observations for s in made.recording.samples}
    assert first.about == ()
    assert [s.observations for s in told.samples] == [true[s.sample] for s in told.samples]
    assert len(told.samples) == 22
    (fit,) = fits.values()
    assert trimmed(fit.off, 1.0) < 0.01


def test_the_last_few_samples_are_no_slip():
    """The last two observations are of one sample later: no guess is from there on, which outliers would explain."""
    made = simulate(Scenario(samples=24), 3)
    wrong = rewriting.shifted(made.recording, None, -1, start=21)
    recorded = {s.sample: s.observations for s in wrong.samples}
    for guess, _ in pairing_errors(made.cell, wrong, made.cameras, [None]):
        told = guess.apply(made.cell, wrong)[1]
        assert min(s.sample for s in told.samples if s.observations != recorded[s.sample]) <= 20


def test_few_samples_give_no_slip():
    """With fewer than six samples to either side there is nothing to start from."""
    made = simulate(Scenario(samples=11), 0)
    assert pairing_errors(made.cell, made.recording, made.cameras, [None]) == []


def test_turned_views_are_found():
    """Of the two readings one turns exactly the views that were read from the other end."""
    board = chessboard_target((8, 6), 0.03)
    made = simulate(Scenario(samples=12, target="pose", board=board), 0)
    cell = replace(made.cell, targets={n: replace(t, target=board) for n, t in made.cell.targets.items()})
    turn = half_turn(board)
    samples = list(made.recording.samples)
    for k in (2, 3, 7):
        (one,) = rewriting.with_targets(Recording((samples[k],)), lambda poses: poses @ turn).samples
        samples[k] = one
    found = half_turns(cell, Recording(tuple(samples)))
    assert {reading.about for reading in found} >= {("board", "2", "3", "7")}
    assert half_turns(cell, made.recording) == []


@pytest.mark.parametrize(("count", "more"), [(10, False), (11, True)])
def test_ten_turned_views_are_listed(count, more):
    """Of more the first ten stand in the words, and all are turned."""
    board = chessboard_target((8, 6), 0.03)
    made = simulate(Scenario(samples=26, target="pose", board=board), 0)
    cell = replace(made.cell, targets={n: replace(t, target=board) for n, t in made.cell.targets.items()})
    turned = rewriting.with_targets(made.recording, lambda poses: poses @ half_turn(board))
    wrong = [
        t if k % 2 and k < 2 * count else s
        for k, (s, t) in enumerate(zip(made.recording.samples, turned.samples, strict=True))
    ]
    numbers = tuple(str(k) for k in range(1, 2 * count, 2))
    (found,) = [h for h in half_turns(cell, Recording(tuple(wrong))) if h.about == ("board", *numbers)]
    assert (", ..." in found.words) == more
    right = found.apply(cell, Recording(tuple(wrong)))[1]
    for mended, true in zip(right.samples, made.recording.samples, strict=True):
        off = mended.observations[0].camera_from_target.inverse() @ true.observations[0].camera_from_target
        assert np.abs(off.log()).max() < 1e-9


@pytest.mark.parametrize("at", [4, 9, 15, 16])
@pytest.mark.parametrize("lost", [0, 1])
def test_the_change_is_where_fewest_samples_are_off(at, lost):
    """Before it as recorded, after it as shifted; what is lost there is off in neither way, and is not counted."""
    rng = np.random.default_rng(0)
    fine, off = 0.002 * rng.uniform(0.8, 1.2, 20), 0.3 * rng.uniform(0.8, 1.2, 20)
    before = np.where(np.arange(20) < at, fine, off)
    after = np.where(np.arange(20) < at + lost, off, fine)
    score, found = pairing._change(before, after, lost)
    counted = np.concatenate([fine[:at], fine[at + lost :]])
    assert found == at
    assert score == pytest.approx(np.sqrt(np.sum(counted**2) / 20))


def test_a_change_nearer_to_an_end_than_four_samples_is_none():
    """The best of the others is told, at which what is off counts as off by four times the rest, whatever it is."""
    before, after = np.full(20, 0.01), np.full(20, np.nan)
    before[18:] = 7.0
    after[18:] = 0.01
    score, found = pairing._change(before, after, 0)
    assert found == 16
    assert score == pytest.approx(np.sqrt((16 * 0.01**2 + 2 * 0.04**2 + 2 * 0.01**2) / 20))
    assert pairing._change(before / 100, after / 100, 0)[1] == 16


def test_loops_that_close_well_are_alike():
    """Below 5 mrad what is smaller still is no better: four times that is as far as a sample can be off."""
    before, after = np.full(20, 1e-6), np.full(20, 1.0)
    before[10:], after[10:] = 1.0, 1e-6
    before[5] = 0.9
    score, found = pairing._change(before, after, 0)
    assert found == 10
    assert score == pytest.approx(np.sqrt((19 * 1e-12 + 0.02**2) / 20))
