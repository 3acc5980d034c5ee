"""Tests of `clock_step`: the clock information of a solution."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views

from basecal.accuracy.clocks import step
from basecal.accuracy.clocks.step import ClockStep, clock_step
from basecal.cell import Clock, RollingShutter
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import Solution, solve_problem
from basecal.estimation.streams.rolling_shutter import KnownGeometry
from basecal.estimation.streams.streams import Synchronised, recording_streams, synchronise
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from stream_cells import Streamed, imaged, streamed


def solve_streams(made: Streamed, offset_s: float) -> tuple[ClockStep, Solution, Synchronised]:
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    offsets = {"arm": 0.0, "wrist": offset_s}
    samples = synchronise(streams, offsets)
    problem, _ = build_problem(made.cell, samples.recording)
    solution = solve_problem(problem, made.cell)
    return clock_step(streams, samples, offsets, solution), solution, samples


@pytest.mark.parametrize("away_s", [-5e-3, 0.0, 5e-3])
def test_step_leads_to_true_offset(away_s: float) -> None:
    """The step leads to the true offset within its sigma, from 5 ms on either side."""
    found, _, _ = solve_streams(streamed(), 0.03 + away_s)
    assert found.clocks == ("wrist",)
    assert found.is_observable.all()
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert sigma < 5e-4
    assert found.step_s[0] + away_s == pytest.approx(0.0, abs=3.3 * sigma)  # fails by chance once in a thousand


def test_answer_changes_with_offset_as_resolved() -> None:
    """The answer's derivative by the offset matches solving again 1 ms away."""
    made, shift = streamed(), 1e-3
    found, at, _ = solve_streams(made, 0.03)
    _, after, _ = solve_streams(made, 0.03 + shift)
    for name, columns in at.problem.columns.items():
        moved = (at.state.transforms[name].inverse() @ after.state.transforms[name]).log()
        np.testing.assert_allclose(found.by_offsets[columns, 0] * shift, moved, atol=3e-6)


def test_prior_holds_offset() -> None:
    """A tight prior determines the offset and its sigma; a free clock has a larger one."""
    free, _, _ = solve_streams(streamed(clock=Clock("free", 0.03)), 0.03)
    held, _, _ = solve_streams(streamed(clock=Clock("prior", 0.025, 1e-6)), 0.03)
    assert held.step_s[0] == pytest.approx(-5e-3, abs=1e-5)
    assert np.sqrt(held.covariance[0, 0]) == pytest.approx(1e-6, rel=1e-3)
    assert np.sqrt(free.covariance[0, 0]) > 1e-5


def test_still_arm_shows_no_clock() -> None:
    """A recording with hardly any motion shows no clock, and its step is zero."""
    made = streamed(still=True)
    found, _, _ = solve_streams(made, 0.0)
    assert not found.is_observable.any()
    np.testing.assert_array_equal(found.step_s, 0.0)
    np.testing.assert_array_equal(found.by_offsets, 0.0)


def test_camera_and_robot_clocks_are_opposite() -> None:
    """The offset of the camera equals minus that of the only robot."""
    made = streamed()
    robots = {"arm": replace(made.cell.robots["arm"], clock=Clock("prior", 0.0, 10.0))}
    streams = recording_streams(replace(made.cell, robots=robots), made.recording)
    assert streams is not None
    offsets = {"arm": 0.0, "wrist": 0.028}
    samples = synchronise(streams, offsets)
    problem, _ = build_problem(made.cell, samples.recording)
    found = clock_step(streams, samples, offsets, solve_problem(problem, made.cell))
    assert set(found.clocks) == {"arm", "wrist"}
    np.testing.assert_allclose(found.by_offsets[:, 0], -found.by_offsets[:, 1], rtol=1e-9)


@pytest.mark.parametrize("away_s", [-4e-6, 0.0, 4e-6])
def test_step_leads_to_true_line_time(away_s: float) -> None:
    """The step leads to the true line time of 20 us from a fifth of it aside, with a known clock."""
    made = imaged(2e-5, RollingShutter("free", 2e-5 + away_s))
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    of, solution = synchronise(streams, streams.stated_offsets), None
    for _ in range(2):  # the first solution corrects the pixels for the line time
        solution = solve_problem(build_problem(made.cell, of.recording)[0], made.cell)
        known = KnownGeometry(made.cell, solution.state.transforms, solution.state.cameras)
        of = synchronise(streams, streams.stated_offsets).correct_rows(known, streams.stated_offsets)
    assert solution is not None
    found = clock_step(streams, of, streams.stated_offsets, solution)
    assert found.clocks == ("wrist line",)
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert sigma < 5e-7
    assert found.step_s[0] + away_s == pytest.approx(0.0, abs=3.3 * sigma + 0.05 * abs(away_s))


def test_step_weighs_views_and_priors(monkeypatch: pytest.MonkeyPatch) -> None:
    """The step is that of Gauss-Newton for a free clock and one with a prior 3 ms away, to rounding."""
    information, gradient = np.array([[4e4, 1e4], [1e4, 9e4]]), np.array([50.0, -70.0])
    across, hessian = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]]), np.diag([10.0, 20.0, 50.0])
    clocks = {"a": Clock("free", 7.0), "b": Clock("prior", 0.1, 5e-3)}
    found = step_from_information(monkeypatch, information, gradient, across, hessian, clocks, {"a": 7.2, "b": 0.103})
    total = information + np.diag([0.0, 5e-3**-2])
    expected = -np.linalg.solve(total, gradient + np.array([0.0, 3e-3 / 5e-3**2]))
    np.testing.assert_allclose(found.step_s, expected)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(total))
    np.testing.assert_allclose(found.by_offsets, -np.linalg.inv(hessian) @ across[0].T)
    assert found.is_observable.all()


def step_from_information(monkeypatch, information, gradient, across, hessian, clocks, offsets) -> ClockStep:
    """The step of clocks with this information from views; one clock may be the camera's line time."""
    about = SimpleNamespace(inverse=np.linalg.pinv(hessian))
    monkeypatch.setattr(step, "situate", lambda solution: SimpleNamespace(groups=[], linearisation=about))
    of_views = SimpleNamespace(information=information[None], gradient=gradient[None])
    monkeypatch.setattr(step, "score", lambda about, every: of_views)
    monkeypatch.setattr(step, "view_sums", lambda about, every: (None, across, None))
    streams = SimpleNamespace(clocks=clocks, estimated_clocks=tuple(clocks), cell=SimpleNamespace(cameras=["wrist"]))
    return clock_step(streams, None, offsets, None)


@pytest.mark.parametrize(
    ("name", "sigma_s", "seen"),
    [("arm", 0.49, True), ("arm", 0.51, False), ("wrist line", 4.9e-4, True), ("wrist line", 5.1e-4, False)],
)
def test_observable_clock_is_known_to_half_a_second(monkeypatch: pytest.MonkeyPatch, name, sigma_s, seen) -> None:
    """A clock is observable if known to half a second, a line time to half a millisecond.

    Else it has no step, no covariance and no effect.
    """
    information = np.diag([sigma_s**-2, 1e4])
    clocks = {name: Clock("free", 0.0), "other": Clock("free", 0.0)}
    across = np.ones((1, 2, 3))
    found = step_from_information(
        monkeypatch, information, np.ones(2), across, np.eye(3), clocks, dict.fromkeys(clocks, 0.0)
    )
    assert found.is_observable.tolist() == [seen, True]
    assert (found.step_s[0] != 0, found.covariance[0, 0] != 0, np.any(found.by_offsets[:, 0])) == (seen,) * 3
    assert found.step_s[1] == pytest.approx(-1e-4)


def test_effects_move_and_widen_observable_offsets() -> None:
    """Effects move and widen observable offsets; others keep zero step and covariance."""
    left = ClockStep(("a", "b", "c"), np.array([1.0, 0.0, 2.0]), np.eye(3), np.zeros((6, 3)), np.array([1, 0, 1]) > 0)
    found = left.add_effects(np.array([0.5, -3.0]), np.array([[4.0, 0.25], [0.25, 9.0]]))
    np.testing.assert_array_equal(found.step_s, [1.5, 0.0, -1.0])
    np.testing.assert_array_equal(found.covariance, [[5.0, 0.0, 0.25], [0.0, 1.0, 0.0], [0.25, 0.0, 10.0]])


def test_clock_without_information_is_unobservable(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock without information has zero variance in the pseudo-inverse but is unobservable."""
    clocks = {"a": Clock("free", 0.0)}
    found = step_from_information(
        monkeypatch, np.zeros((1, 1)), np.zeros(1), np.zeros((1, 1, 3)), np.eye(3), clocks, {"a": 0.0}
    )
    assert not found.is_observable.any()


def test_views_move_with_clocks_of_camera_and_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """A late camera advances all flanges, a late robot delays itself; a line time counts by the mean row."""
    rng = np.random.default_rng(0)
    by = {"eye": rng.normal(size=(3, 6, 6)), "hand": rng.normal(size=(3, 6, 6))}
    row = rng.normal(size=(3, 6, 6))
    velocity = {name: rng.normal(size=(9, 6)) for name in by}
    robots = {name: {k: SimpleNamespace(velocity=v) for k, v in enumerate(of)} for name, of in velocity.items()}
    monkeypatch.setattr(step, "_mean_row", lambda situation, k: row)
    numbers = np.array([7, 2, 5])
    for eye, hand in (("eye", "hand"), (None, "hand"), ("eye", None)):
        at = SE3.identity((3,))
        group = replace(views(end(eye, at), end(hand, at), camera="wrist"), sample=numbers)
        situation = SimpleNamespace(
            problem=SimpleNamespace(groups=[None, group]), flange_jacobian=lambda k, robot: by[robot]
        )
        clocks = ("hand", "wrist", "wrist line", "eye", "other")
        found = step._clock_jacobian(situation, 1, clocks, SimpleNamespace(robots=robots))
        moved = {name: np.einsum("nij,nj->ni", by[name], velocity[name][numbers]) for name in (eye, hand) if name}
        whole = sum(moved.values())
        none = np.zeros((3, 6))
        expected = [-moved.get("hand", none), whole, np.einsum("nij,nj->ni", row, whole), -moved.get("eye", none), none]
        assert found.shape == (3, 1, 6, 5)
        np.testing.assert_allclose(found[:, 0], np.stack(expected, axis=-1), atol=1e-12)


def test_mean_row_of_one_row_is_that_row() -> None:
    """The mean row of pixels in one row is that row in every direction; without pixels it is zero."""
    made = simulate(Scenario(samples=3), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    pixels = group.measurement.pixels.copy()
    pixels[..., 1] = [[100.0], [200.0], [300.0]]
    group = replace(group, measurement=replace(group.measurement, pixels=pixels))
    at = SE3.exp(np.array([[0.1, 0.0, 0.7, 0.2, -0.1, 0.3]] * 3))
    situation = SimpleNamespace(
        problem=problem.with_groups([group]),
        links=[SimpleNamespace(camera_from_target=at)],
        state=SimpleNamespace(cameras=made.cameras),
    )
    found = step._mean_row(situation, 0)
    np.testing.assert_allclose(found, np.array([100.0, 200.0, 300.0])[:, None, None] * np.eye(6), atol=1e-6)
    poses = replace(group, measurement=None)
    situation.problem = problem.with_groups([poses])
    np.testing.assert_array_equal(step._mean_row(situation, 0), np.zeros((3, 6, 6)))
