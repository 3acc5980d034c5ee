"""Tests of the search for clock offsets without a guess."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.clocks import search
from basecal.accuracy.clocks.search import search_offsets
from basecal.accuracy.clocks.step import ClockStep
from basecal.cell import Clock, Robot, RollingShutter
from basecal.errors import NotObservable
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve, solve_problem
from basecal.estimation.streams.streams import recording_streams
from quick import quick
from stream_cells import Streamed, imaged, streamed

SIGMA_S = 4e-4  # largest sigma of the offset of these recordings


def find_offsets(made: Streamed, settings: Settings | None = None) -> dict[str, float]:
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    return search_offsets(streams, settings or Settings()).offsets_s


@pytest.mark.journey
@pytest.mark.parametrize(
    ("offset_s", "stated"),
    quick(product((0.0, -0.04, 0.43), (True, False)), [(0.0, True), (-0.04, False), (0.43, True)]),
)
def test_offset_is_found(offset_s: float, stated: bool) -> None:
    """A clock offset is found within its sigma."""
    assert find_offsets(streamed(offset_s, stated=stated))["wrist"] == pytest.approx(offset_s, abs=3.3 * SIGMA_S)


def test_offset_is_found_from_guess() -> None:
    """A clock offset is found beside a guess 0.2 s off, with stamps of 1.6e9 s."""
    made = streamed(1.6e9, clock=Clock("free", 1.6e9 + 0.2))
    assert find_offsets(made)["wrist"] - 1.6e9 == pytest.approx(0.0, abs=3.3 * SIGMA_S)


def test_fixed_offset_is_kept() -> None:
    """A fixed clock offset is kept."""
    assert find_offsets(streamed(0.03, clock=Clock("fixed", 0.011)))["wrist"] == 0.011


@pytest.mark.slow
def test_many_views_give_same_offset() -> None:
    """An offset of a recording with over 200 views is found, too."""
    made = streamed(0.02, seconds=26.0)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert len(streams.instants) > 200
    assert search_offsets(streams, Settings()).offsets_s["wrist"] == pytest.approx(0.02, abs=3.3 * SIGMA_S)


def test_samples_use_estimated_offsets() -> None:
    """The samples are interpolated at the estimated offsets."""
    made = streamed(0.03)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    of = search_offsets(streams, Settings())
    stamps = [s.stamp_s for s in of.recording.samples]
    np.testing.assert_allclose(stamps, np.arange(0.5, 7.5, 0.1) - 0.03 + of.offsets_s["wrist"], atol=1e-9)


@pytest.mark.journey
@pytest.mark.parametrize("shutter", [RollingShutter("fixed", 3e-5), RollingShutter("prior", 2.7e-5, 3e-6)])
def test_rows_are_corrected_by_line_time(shutter: RollingShutter) -> None:
    """Pixels are corrected by the estimated line time of their rows, which explains the views."""
    made = imaged(3e-5, shutter)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    of = search_offsets(streams, Settings())
    assert of.offsets_s["wrist line"] == pytest.approx(3e-5, abs=1e-6)
    solution = solve(of.streams.cell, made.recording)
    by_rows = solve_problem(build_problem(made.cell, of.recording)[0], made.cell)
    assert by_rows.cost < 1.2 * by_rows.dof
    assert solution.cost > 5 * by_rows.cost  # uncorrected: each view at its mean row


def try_offsets(made: Streamed, monkeypatch: pytest.MonkeyPatch, misfit) -> tuple[list[float], float]:
    """The offsets of the camera's clock that are tried, and the best by a misfit."""
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    seen: list[float] = []

    def misfit_of(streams, offsets, settings):
        """Records the offset and returns the misfit."""
        seen.append(offsets["wrist"])
        return misfit(offsets["wrist"])

    monkeypatch.setattr(search, "_misfit", misfit_of)
    return seen, search._best_offset(streams, {**streams.stated_offsets, "wrist": -5.0}, "wrist", Settings())["wrist"]


def test_offset_range_is_a_second_or_three_sigmas(monkeypatch: pytest.MonkeyPatch) -> None:
    """Offsets are tried within a second, or three sigmas, of the stated one in twenty steps.

    If none can be solved, the offset stays.
    """
    seen, best = try_offsets(streamed(clock=Clock("free", 2.0)), monkeypatch, lambda at: abs(at - 2.31))
    np.testing.assert_allclose(seen, 2.0 + np.linspace(-1, 1, 21))
    assert best == pytest.approx(2.3)
    seen, best = try_offsets(streamed(clock=Clock("prior", 2.0, 0.1)), monkeypatch, lambda at: -at)
    np.testing.assert_allclose(seen, np.linspace(1.7, 2.3, 21))
    assert best == pytest.approx(2.3)
    assert try_offsets(streamed(), monkeypatch, lambda at: np.inf)[1] == -5.0


def test_step_is_at_most_a_second() -> None:
    """A step is at most a second, beyond which the arm's velocity is not informative; other clocks stay."""
    step = ClockStep(("a", "b"), np.array([0.25, -3.0]), np.eye(2), np.zeros((6, 2)), np.ones(2, dtype=bool))
    assert search._apply_step({"a": 1.0, "b": 2.0, "c": 3.0}, step) == {"a": 1.25, "b": 1.0, "c": 3.0}


def test_misfit_is_smallest_at_true_offset() -> None:
    """The misfit per residual is about one at the true offset, and larger if views are paired with other times."""
    streams = recording_streams((made := streamed(0.03)).cell, made.recording)
    assert streams is not None
    few = streams.thin(12)
    at, beside = (
        search._misfit(few, {**streams.stated_offsets, "wrist": offset}, Settings()) for offset in (0.03, 0.13)
    )
    assert 0.3 < at < 1.5
    assert beside > 10 * at


def make_solution(hopeless: bool = False, robots: object = (), jitter_s: object = (), of_arms: bool = False) -> object:
    """A solution with the given properties."""
    noise = SimpleNamespace(robots=robots, jitter_s=jitter_s)
    return SimpleNamespace(problem=hopeless, state=None, noise=noise, of_arms=of_arms)


def run_steps(monkeypatch: pytest.MonkeyPatch, steps, solution=None, names=("a",), fails_at: int = 99):
    """Result of `_step_offsets` for these steps, in sigmas of 0.01 s, and the starts of the solutions."""
    near, left = [], iter(steps)

    def solve_once(streams, offsets, settings, last):
        """Returns the same solution each time."""
        near.append(last)
        if len(near) > fails_at:
            raise NotObservable("no")
        return solution or make_solution(), "samples"

    def step(streams, samples, offsets, last):
        """Returns the next step."""
        sizes = 0.01 * np.broadcast_to(next(left), (len(names),))
        return ClockStep(names, sizes, 1e-4 * np.eye(len(names)), np.zeros((0, 1)), np.ones(len(names), dtype=bool))

    monkeypatch.setattr(search, "_solve_at_offsets", solve_once)
    monkeypatch.setattr(search, "clock_step", step)
    monkeypatch.setattr(search, "is_hopeless", lambda problem, state: problem)
    monkeypatch.setattr(search, "has_plausible_noise", lambda last: last.of_arms)
    return search._step_offsets(SimpleNamespace(estimated_clocks=names), {"a": 1.0, "b": 2.0}, Settings()), near


@pytest.mark.parametrize(
    ("steps", "solutions", "end"),
    [
        ([3.0, 1.0, 0.04], 3, 1.0404),
        ([3.0, -1.0, 0.06, -0.04, 9.0], 4, 1.0202),
        ([0.0, 0.0, 9.0], 2, 1.0),  # a solution corrects the pixels, so the first one does not end the search
        ([1.0] * 20, 8, 1.08),
    ],
)
def test_steps_continue_until_small(monkeypatch: pytest.MonkeyPatch, steps, solutions, end) -> None:
    """Steps continue until they are below a twentieth of a sigma, each from the previous solution, at most eight."""
    (offsets, last, explained), near = run_steps(monkeypatch, steps)
    assert len(near) == solutions
    assert near == [None, *[last] * (solutions - 1)]
    assert offsets == {"a": pytest.approx(end), "b": 2.0}
    assert explained


def test_every_clock_must_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    """If one of two clocks still moves, another solution follows."""
    steps = [[0.01, 1.0], [0.01, 0.5], [0.5, 0.01], [0.01, 0.01]]
    assert len(run_steps(monkeypatch, steps, names=("a", "b"))[1]) == 4


def test_two_solutions_correct_pixels_without_clocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a clock to find, two solutions correct the pixels."""
    assert len(run_steps(monkeypatch, [], names=())[1]) == 2


def test_failed_solve_keeps_offsets(monkeypatch: pytest.MonkeyPatch) -> None:
    """If a solve fails, the offsets and the last solution are kept, and the views are not explained."""
    assert run_steps(monkeypatch, [1.0], fails_at=0)[0] == ({"a": 1.0, "b": 2.0}, None, False)
    (offsets, last, explained), _ = run_steps(monkeypatch, [1.0, 1.0], fails_at=1)
    assert (offsets, last is not None, explained) == ({"a": pytest.approx(1.01), "b": 2.0}, True, False)


@pytest.mark.parametrize(
    ("solution", "explained"),
    [
        (make_solution(), True),
        (make_solution(hopeless=True), False),
        (make_solution(robots=("arm",)), False),
        (make_solution(jitter_s=("wrist",)), False),
        (make_solution(robots=("arm",), of_arms=True), True),
        (make_solution(hopeless=True, robots=("arm",), of_arms=True), False),
    ],
)
def test_plausible_noise_explains_views(monkeypatch: pytest.MonkeyPatch, solution, explained) -> None:
    """Estimated noise must be plausible to explain the views; a hopeless fit is never explained."""
    assert run_steps(monkeypatch, [0.0, 0.0], solution)[0][2] == explained


def record_search(
    monkeypatch: pytest.MonkeyPatch, explained: bool, views: int
) -> tuple[list[object], dict[str, float]]:
    """The steps of `search_offsets` in order, and its final offsets."""
    done: list[object] = []

    def thinned(count):
        """At most so many views."""
        return SimpleNamespace(**{**vars(streams), "instants": range(min(count, views)), "views": count})

    streams = SimpleNamespace(
        stated_offsets={"a": 0.0}, cell=SimpleNamespace(cameras=["wrist"]), estimated_clocks=("a", "wrist line", "b"),
        instants=range(views), thin=thinned, views="all",
    )  # fmt: skip

    def step(of, offsets, settings):
        """Increases the offset by one each time."""
        done.append((of.views, dict(offsets)))
        return {"a": offsets["a"] + 1.0}, "last", explained

    def best(of, offsets, name, settings):
        """Increases the offset by ten for each clock."""
        done.append((of.views, name))
        return {"a": offsets["a"] + 10.0}

    monkeypatch.setattr(search, "_step_offsets", step)
    monkeypatch.setattr(search, "_best_offset", best)
    monkeypatch.setattr(search, "_synchronise", lambda of, offsets, last: (of.views, last))
    found = search_offsets(streams, Settings())
    assert (found.solution, found.synchronised) == ("last", ("all", "last"))
    return done, found.offsets_s


def test_offsets_are_stepped_before_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Offsets are stepped from the stated ones with few views; if that explains nothing, clocks are searched.

    Line times are not searched; the last steps use all views.
    """
    assert record_search(monkeypatch, True, 200) == ([(200, {"a": 0.0})], {"a": 1.0})
    assert record_search(monkeypatch, True, 201) == ([(200, {"a": 0.0}), ("all", {"a": 1.0})], {"a": 2.0})
    tries: list[object] = [(200, {"a": 0.0}), (40, "a"), (40, "b"), (200, {"a": 20.0})]
    assert record_search(monkeypatch, False, 200) == (tries, {"a": 21.0})


def test_misfit_is_log_likelihood_per_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """The misfit is minus twice the log likelihood per residual, with estimated sigmas by their counts.

    Robots are exact, and descents are short.
    """
    given = []

    def solve_once(streams, offsets, settings):
        """Returns a solution with a cost of 12."""
        given.append((streams.cell.robots, settings))
        noise = SimpleNamespace(noise=SimpleNamespace(pixel_px=0.5, pose_m=2.0))
        return SimpleNamespace(cost=12.0, noise=noise, problem=None), None

    counts = {"stated": 10, "pixel_px": 20, "pose_m": 5}
    monkeypatch.setattr(search, "_solve_at_offsets", solve_once)
    monkeypatch.setattr(search, "residual_counts", lambda problem: counts)
    made = streamed(seconds=2.0)
    cell = replace(made.cell, robots={"arm": Robot("arm", noise=np.full(6, 1e-3))})
    streams = recording_streams(cell, made.recording)
    assert streams is not None
    expected = (12 + 40 * np.log(0.5) + 10 * np.log(2.0)) / 35
    assert search._misfit(streams, {}, Settings()) == pytest.approx(expected)
    ((robots, settings),) = given
    assert robots["arm"].noise is None
    assert (settings.robot_noise, settings.iterations < 20) == ("stated", True)


@pytest.mark.parametrize("error", [NotObservable("no"), np.linalg.LinAlgError()])
def test_failed_solve_has_infinite_misfit(monkeypatch: pytest.MonkeyPatch, error) -> None:
    """A failed solve has an infinite misfit."""

    def fails(*given):
        raise error

    monkeypatch.setattr(search, "_solve_at_offsets", fails)
    made = streamed(seconds=2.0)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert search._misfit(streams, {}, Settings()) == np.inf


@pytest.mark.parametrize(("noise", "expected"), [("stated", "plain"), ("estimated", "with noise")])
def test_robot_noise_is_estimated_unless_stated(monkeypatch: pytest.MonkeyPatch, noise, expected) -> None:
    """Robot noise is estimated unless it is taken as stated, for samples at these offsets."""
    monkeypatch.setattr(search, "solve_problem", lambda problem, cell, settings: "plain")
    monkeypatch.setattr(search, "with_noise", lambda plain, settings: "with noise")
    made = streamed(seconds=2.0)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    solution, samples = search._solve_at_offsets(streams, streams.stated_offsets, Settings(robot_noise=noise))
    assert solution == expected
    assert len(samples.recording.samples) == len(streams.instants)
