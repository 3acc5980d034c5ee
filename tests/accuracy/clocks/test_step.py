"""What a solution says of clocks."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.clocks.step import ClockStep, clock_step
from basecal.cell import Clock, RollingShutter
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import Solution, solve_packed
from basecal.estimation.streams.rolling_shutter import Known
from basecal.estimation.streams.streams import Synchronised, streams_of, synchronised
from stream_cells import Streamed, pictured, streamed


def solved(made: Streamed, offset_s: float) -> tuple[ClockStep, Solution, Synchronised]:
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    offsets = {"arm": 0.0, "wrist": offset_s}
    samples = synchronised(streams, offsets)
    problem, _ = build_problem(made.cell, samples.recording)
    solution = solve_packed(problem, made.cell)
    return clock_step(streams, samples, offsets, solution), solution, samples


@pytest.mark.parametrize("away_s", [-5e-3, 0.0, 5e-3])
def test_a_step_leads_to_the_true_offset(away_s: float) -> None:
    found, _, _ = solved(streamed(), 0.03 + away_s)
    assert found.clocks == ("wrist",)
    assert found.seen.all()
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert sigma < 5e-4
    assert found.step_s[0] + away_s == pytest.approx(0.0, abs=3.3 * sigma)  # chance: once in a thousand


def test_the_answer_goes_with_the_offset_as_solving_again_does() -> None:
    made, shift = streamed(), 1e-3
    found, at, _ = solved(made, 0.03)
    _, after, _ = solved(made, 0.03 + shift)
    for name, columns in at.problem.columns.items():
        moved = (at.state.transforms[name].inverse() @ after.state.transforms[name]).log()
        np.testing.assert_allclose(found.by_offsets[columns, 0] * shift, moved, atol=3e-6)


def test_a_prior_holds_an_offset() -> None:
    free, _, _ = solved(streamed(clock=Clock("free", 0.03)), 0.03)
    held, _, _ = solved(streamed(clock=Clock("prior", 0.025, 1e-6)), 0.03)
    assert held.step_s[0] == pytest.approx(-5e-3, abs=1e-5)
    assert np.sqrt(held.covariance[0, 0]) == pytest.approx(1e-6, rel=1e-3)
    assert np.sqrt(free.covariance[0, 0]) > 1e-5


def test_what_hardly_moves_shows_no_clock() -> None:
    made = streamed(still=True)
    found, _, _ = solved(made, 0.0)
    assert not found.seen.any()
    np.testing.assert_array_equal(found.step_s, 0.0)
    np.testing.assert_array_equal(found.by_offsets, 0.0)


def test_two_arms_of_the_same_clock_count_together() -> None:
    """The offset of the camera is minus that of the one robot there is."""
    made = streamed()
    robots = {"arm": replace(made.cell.robots["arm"], clock=Clock("prior", 0.0, 10.0))}
    streams = streams_of(replace(made.cell, robots=robots), made.recording)
    assert streams is not None
    offsets = {"arm": 0.0, "wrist": 0.028}
    samples = synchronised(streams, offsets)
    problem, _ = build_problem(made.cell, samples.recording)
    found = clock_step(streams, samples, offsets, solve_packed(problem, made.cell))
    assert set(found.clocks) == {"arm", "wrist"}
    np.testing.assert_allclose(found.by_offsets[:, 0], -found.by_offsets[:, 1], rtol=1e-9)


@pytest.mark.parametrize("away_s", [-4e-6, 0.0, 4e-6])
def test_a_step_leads_to_the_true_line_time(away_s: float) -> None:
    """Of rows of 20 us, from a fifth of that aside; the clock known."""
    made = pictured(2e-5, RollingShutter("free", 2e-5 + away_s))
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    of, solution = synchronised(streams, streams.stated), None
    for _ in range(2):  # as the line time stands, pixels are mended by the first solution
        solution = solve_packed(build_problem(made.cell, of.recording)[0], made.cell)
        known = Known(made.cell, solution.state.transforms, solution.state.cameras)
        of = synchronised(streams, streams.stated).at_once(known, streams.stated)
    assert solution is not None
    found = clock_step(streams, of, streams.stated, solution)
    assert found.clocks == ("wrist line",)
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert sigma < 5e-7
    assert found.step_s[0] + away_s == pytest.approx(0.0, abs=3.3 * sigma + 0.05 * abs(away_s))
