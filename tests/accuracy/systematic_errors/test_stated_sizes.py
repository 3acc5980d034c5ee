"""What the sizes of targets leave uncertain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.stated_sizes import moved_by_sizes
from basecal.accuracy.widening import solution_step
from basecal.cell import Recording
from basecal.effects.faces.found import FoundEffect
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

OPEN = Scenario(samples=12, state_pixel_noise=False, robot_noise=(1e-4, 1e-4))
MADE = simulate(OPEN, 3)
STATED = Settings(robot_noise="stated")
FOUND = FoundEffect("target_size", "length-scale", "board", False, True, None, "", *(np.zeros(k) for k in (1, 1, 1)))


def with_board(cell, share=1.0, **stated):
    board = cell.targets["board"]
    target = replace(board.target, points=board.target.points * share)
    return replace(cell, targets={"board": replace(board, target=target, **stated)})


def test_one_sigma_moves_the_answer_as_a_larger_board_does():
    """A sigma far below what the data tell moves the columns by its own difference quotient."""
    sigma = 1e-7
    cell = with_board(MADE.cell, size_sigma=sigma)
    solution = solve(cell, MADE.recording, STATED)
    (moved,) = moved_by_sizes(cell, solution, None)
    share = 1e-4
    larger = solve(with_board(MADE.cell, 1 + share), MADE.recording, STATED)
    expected = solution_step(solution, larger) * sigma / share
    np.testing.assert_allclose(np.abs(moved), np.abs(expected), rtol=0.02, atol=0.01 * np.abs(expected).max())


def test_a_wide_sigma_counts_as_far_as_the_data_tell():
    """Ten times as wide a sigma beyond the data's own changes little."""
    moves = []
    for sigma in (0.1, 1.0):
        cell = with_board(MADE.cell, size_sigma=sigma)
        moves.append(moved_by_sizes(cell, solve(cell, MADE.recording, STATED), None)[0])
    np.testing.assert_allclose(moves[0], moves[1], rtol=1e-3)


@pytest.mark.parametrize(
    ("made", "stated", "found", "count"),
    [
        (MADE, {}, None, 1),
        (MADE, {"size_sigma": 0.0}, None, 0),
        (MADE, {}, FOUND, 0),
        (MADE, {}, replace(FOUND, about="other"), 1),
        (simulate(replace(OPEN, state_pixel_noise=True), 3), {}, None, 0),
        (simulate(replace(OPEN, state_pixel_noise=True), 3), {"size_sigma": 2e-4}, None, 1),
        (simulate(replace(OPEN, target="led"), 3), {}, None, 0),
    ],
)
def test_which_targets_have_a_size_that_counts(made, stated, found, count):
    """Those whose views state no noise, or that state a sigma: not exact, not found, not single points."""
    name = next(iter(made.cell.targets))
    entry = replace(made.cell.targets[name], **stated)
    cell = replace(made.cell, targets={name: entry})
    assert len(moved_by_sizes(cell, solve(cell, made.recording, STATED), found)) == count


def test_an_answer_that_fails_has_none():
    """Of a solve that did not converge."""
    solution = solve(MADE.cell, Recording(MADE.recording.samples), STATED)
    assert moved_by_sizes(MADE.cell, replace(solution, converged=False), None) == []
