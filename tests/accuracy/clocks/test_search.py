"""Offsets of clocks from nothing."""

from itertools import product

import numpy as np
import pytest

from basecal.accuracy.clocks import search
from basecal.accuracy.clocks.search import clocked
from basecal.accuracy.clocks.step import ClockStep
from basecal.cell import Clock, RollingShutter
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve, solve_packed
from basecal.estimation.streams.streams import streams_of
from quick import quick
from stream_cells import Streamed, pictured, streamed

SIGMA_S = 4e-4  # of the offset of these recordings, at most


def found(made: Streamed, settings: Settings | None = None) -> dict[str, float]:
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    return clocked(streams, settings or Settings()).offsets_s


@pytest.mark.parametrize(
    ("offset_s", "stated"),
    quick(product((0.0, -0.04, 0.43), (True, False)), [(0.0, True), (-0.04, False), (0.43, True)]),
)
def test_an_offset_is_found(offset_s: float, stated: bool) -> None:
    assert found(streamed(offset_s, stated=stated))["wrist"] == pytest.approx(offset_s, abs=3.3 * SIGMA_S)


def test_an_offset_is_found_beside_a_guess() -> None:
    made = streamed(1.6e9, clock=Clock("free", 1.6e9 + 0.2))
    assert found(made)["wrist"] - 1.6e9 == pytest.approx(0.0, abs=3.3 * SIGMA_S)


def test_a_fixed_offset_stays() -> None:
    assert found(streamed(0.03, clock=Clock("fixed", 0.011)))["wrist"] == 0.011


def test_many_views_end_where_all_do() -> None:
    made = streamed(0.02, seconds=26.0)
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    assert len(streams.instants) > 200
    assert clocked(streams, Settings()).offsets_s["wrist"] == pytest.approx(0.02, abs=3.3 * SIGMA_S)


def test_the_samples_are_by_the_offsets_that_were_found() -> None:
    made = streamed(0.03)
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    of = clocked(streams, Settings())
    stamps = [s.stamp_s for s in of.recording.samples]
    np.testing.assert_allclose(stamps, np.arange(0.5, 7.5, 0.1) - 0.03 + of.offsets_s["wrist"], atol=1e-9)


@pytest.mark.parametrize("shutter", [RollingShutter("fixed", 3e-5), RollingShutter("prior", 2.7e-5, 3e-6)])
def test_rows_are_mended_by_the_line_time_that_is_found(shutter: RollingShutter) -> None:
    made = pictured(3e-5, shutter)
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    of = clocked(streams, Settings())
    assert of.offsets_s["wrist line"] == pytest.approx(3e-5, abs=1e-6)
    solution = solve(of.streams.cell, made.recording)
    mended = solve_packed(build_problem(made.cell, of.recording)[0], made.cell)
    assert mended.cost < 1.2 * mended.dof
    assert solution.cost > 5 * mended.cost  # each view by its mean row alone


def tried(made: Streamed, monkeypatch: pytest.MonkeyPatch, misfit) -> tuple[list[float], float]:
    """Offsets that are tried of the camera's clock, and the best by a misfit."""
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    seen: list[float] = []

    def misfit_of(streams, offsets, settings):
        """Kept, and told."""
        seen.append(offsets["wrist"])
        return misfit(offsets["wrist"])

    monkeypatch.setattr(search, "_misfit", misfit_of)
    return seen, search._best(streams, {**streams.stated, "wrist": -5.0}, "wrist", Settings())["wrist"]


def test_an_offset_is_looked_for_within_a_second_or_three_sigmas(monkeypatch: pytest.MonkeyPatch) -> None:
    """About what is stated, in twenty steps; where none can be solved it stays as it was."""
    seen, best = tried(streamed(clock=Clock("free", 2.0)), monkeypatch, lambda at: abs(at - 2.31))
    np.testing.assert_allclose(seen, 2.0 + np.linspace(-1, 1, 21))
    assert best == pytest.approx(2.3)
    seen, best = tried(streamed(clock=Clock("prior", 2.0, 0.1)), monkeypatch, lambda at: -at)
    np.testing.assert_allclose(seen, np.linspace(1.7, 2.3, 21))
    assert best == pytest.approx(2.3)
    assert tried(streamed(), monkeypatch, lambda at: np.inf)[1] == -5.0


def test_a_step_is_no_longer_than_a_second() -> None:
    """Beyond it the arm's velocity tells nothing; clocks without a step stay."""
    step = ClockStep(("a", "b"), np.array([0.25, -3.0]), np.eye(2), np.zeros((6, 2)), np.ones(2, dtype=bool))
    assert search._after({"a": 1.0, "b": 2.0, "c": 3.0}, step) == {"a": 1.25, "b": 1.0, "c": 3.0}


def test_the_misfit_is_least_at_the_true_offset() -> None:
    """For each residual about one by stated sigmas; more where views are taken for those of other instants."""
    streams = streams_of((made := streamed(0.03)).cell, made.recording)
    assert streams is not None
    few = streams.thinned(12)
    at, beside = (search._misfit(few, {**streams.stated, "wrist": offset}, Settings()) for offset in (0.03, 0.13))
    assert 0.3 < at < 1.5
    assert beside > 10 * at
