"""Tests of `widen` and `curved_covariance`: the covariance covers another answer along the step to it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.journeys.raw import BOARD, LENS

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.covariance import widening
from basecal.accuracy.covariance.widening import curved_covariance, largest_shift, state_step, widen
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.solve import solve
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, SimulatedCell, simulate

MADE = simulate(Scenario(samples=10), 0)
SOLUTION = solve(MADE.cell, MADE.recording)


def test_covariance_grows_by_squared_step():
    """The covariance grows by the square of the step along it, not across it."""
    moved = np.zeros(SOLUTION.problem.width)
    moved[2] = 3e-3
    wider = widen(SOLUTION, moved).covariance - SOLUTION.covariance
    assert np.isclose(wider[2, 2], 9e-6)
    wider[2, 2] = 0.0
    assert not np.any(wider)


def test_step_between_solutions_is_that_of_transforms():
    """The step is zero from an answer to itself, and the transforms' tangents to that of half the samples."""
    np.testing.assert_allclose(state_step(SOLUTION.problem, SOLUTION.state, SOLUTION.state), 0.0, atol=1e-15)
    half = solve(MADE.cell, type(MADE.recording)(MADE.recording.samples[:6]))
    step = state_step(SOLUTION.problem, SOLUTION.state, half.state)
    for name, where in SOLUTION.problem.columns.items():
        expected = (SOLUTION.state.transforms[name].inverse() @ half.state.transforms[name]).log()
        np.testing.assert_allclose(step[where], expected)


def test_step_of_point_has_no_rotation():
    """The step of each transform has the width of its columns, so that of a point has no rotation."""
    full = {"a": SE3.from_rotvec([0.1, 0.2, 0.3], [1, 2, 3]), "b": SE3.from_rotvec([0, 0, 1.0], [0, 1, 0])}
    tangents = {"a": np.array([1e-3, 2e-3, 0, 1e-3, 0, 2e-3]), "b": np.array([3e-3, 0, -1e-3, 0, 0, 0])}
    moved = {name: full[name] @ SE3.exp(tangent) for name, tangent in tangents.items()}
    problem = SimpleNamespace(width=11, columns={"b": slice(2, 5), "robot": slice(0, 2), "a": slice(5, 11)})
    step = state_step(problem, *(SimpleNamespace(transforms=each, cameras={}) for each in (full, moved)))
    np.testing.assert_allclose(step, [0, 0, 3e-3, 0, -1e-3, *tangents["a"]], atol=1e-15)


def test_step_of_lens_is_that_of_parameters():
    """The step of a lens is that of its parameters, in its columns; the others are those of transforms."""
    made = simulate(Scenario(samples=10, intrinsics="free"), 0)
    solution = solve(made.cell, made.recording)
    lens = solution.state.cameras["wrist"]
    off = 0.5 * np.arange(1.0, len(lens.parameters) + 1)
    moved = replace(solution.state, cameras={"wrist": lens.with_parameters(lens.parameters + off)})
    step = state_step(solution.problem, solution.state, moved)
    where = solution.problem.columns["wrist"]
    np.testing.assert_allclose(step[where], off)
    fewer = lens.with_parameters(lens.parameters[:-1])
    before = replace(solution.state, cameras={"wrist": fewer})
    added = state_step(solution.problem, before, moved)[where]
    np.testing.assert_allclose(added, [*off[:-1], lens.parameters[-1] + off[-1]])
    step[where] = 0.0
    np.testing.assert_allclose(step, 0.0, atol=1e-15)


def test_largest_shift_is_measured_by_covariance():
    """The largest shift is measured by the covariance.

    A millimetre along a well-known direction exceeds ten along another.
    """
    unit = np.zeros((2, SOLUTION.problem.width))
    unit[0, 0], unit[1, 3] = 1e-3, 1e-3
    covariance = np.diag(np.where(np.arange(SOLUTION.problem.width) == 0, 1e-4, 1e-8))
    known = replace(SOLUTION, covariance=covariance)
    np.testing.assert_array_equal(largest_shift(known, [10 * unit[0], unit[1]]), unit[1])


BASE = "eye_base_from_hand_base"
KEPT = {"camera": LENS, "board": BOARD, "distance_m": (0.35, 0.55), "joints": True, "pixel_px": 0.0075}
DRAWS, HOLD = 16, 0.9999


def exact_joints(samples: int, seed: int, **more: object) -> SimulatedCell:
    """Two arms whose joints are recorded exactly, except for offsets known to 2 deg."""
    offset_options = {"joint_offset_rad": np.radians(2), "joint_offsets": "prior"}
    return simulate(Scenario(samples=samples, **{**KEPT, **offset_options, **more}), seed)  # type: ignore[arg-type]


def squared_error(made: SimulatedCell, mean: object, covariance: Array) -> float:
    """Squared error of the base in sigmas."""
    off = (mean.inverse() @ made.truth[BASE]).log()  # type: ignore[attr-defined]
    return float(off @ np.linalg.solve(covariance, off))


@pytest.mark.journey
def test_arc_is_within_curved_ellipsoid() -> None:
    """Offsets of the first joints rotate the base by degrees.

    With the curved covariance the error is in the ellipsoid. The linear one is micrometres thin.
    """
    made = exact_joints(20, 9)
    solution = solve(made.cell, made.recording)
    linear, mean = solution.joint_transform_covariance([BASE]), solution.state.transforms[BASE]
    assert squared_error(made, mean, linear) > 1e3
    assert squared_error(made, mean, linear + curved_covariance(solution, [BASE])) < chi2.ppf(HOLD, 6)


def test_well_known_base_has_no_curved_covariance() -> None:
    """A well-known base needs no curved covariance, and none is computed."""
    made = exact_joints(20, 9, joint_offset_rad=0.0, joint_offsets="fixed", robot_noise=(1e-4, 2e-4))
    assert not curved_covariance(solve(made.cell, made.recording), [BASE]).any()


@pytest.mark.slow
def test_exact_joints_are_calibrated_within_covariance() -> None:
    """No exact-joint cell is refused.

    NEES/6 is that of normals, 0.6 to 1.5 of 16 draws of six numbers with long tails.
    """
    squares = []
    for seed in range(100, 100 + DRAWS):
        made = exact_joints(40, seed, intrinsics="free", state_robot_noise=False)
        found = calibrate(made.cell, made.recording)
        assert found.verdict != "refused", found.unobservable
        squares.append(squared_error(made, found[BASE].mean, found[BASE].covariance))
    assert max(squares) < chi2.ppf(1 - 1e-5, 6)
    assert 0.6 < np.mean(squares) / 6 < 1.5


@pytest.mark.journey
def test_shared_stop_errors_add_no_arc() -> None:
    """Offsets of the other arm, contained in its noise, do not lengthen the arc of an arm with a prior on offsets.

    States of the equations without that noise, along directions that it widens, gave the base four times this sigma.
    """
    options = {"joints": True, "joint_offset_rad": 0.01, "joint_offsets": "prior", "state_robot_noise": False}
    made = simulate(Scenario(samples=25, **options), 4)  # type: ignore[arg-type]
    robots = {**made.cell.robots, "hand": replace(made.cell.robots["hand"], parameters={})}
    base = calibrate(replace(made.cell, robots=robots), made.recording)[BASE]
    assert base.sigma_norms[0] < 0.015
    assert squared_error(made, base.mean, base.covariance) < chi2.ppf(HOLD, 6)


def test_arc_has_second_moments_of_products(monkeypatch) -> None:
    """The curved covariance has the second moments of products of sigmas: squares, mixed products and shared parts.

    The state errors are such products along x, y and z; lengths are linear, and the middle one of three directions is
    straight.
    """
    square = {0: np.array([1e-3, 0, 2e-3]), 2: np.array([0, 3e-3, -1e-3])}
    mixed, linear, start = np.array([2e-3, -1e-3, 1e-3]), np.array([0.3, 0.2, 0.1]), np.array([0, 5e-3, 1e-3])
    at = SE3.from_rotvec([0.3, -0.2, 0.1], [1, 2, 3])

    def states(solution: object, sigmas: Array, steps: Array) -> SimpleNamespace:
        assert steps.shape == (4, 3)
        off = sum(np.outer(sigmas[:, k] ** 2, each) for k, each in square.items())
        off = off + np.outer(sigmas[:, 0] * sigmas[:, 2], mixed) + np.outer(sigmas.sum(1), linear) + start
        return SimpleNamespace(transforms={"base": at @ SE3.exp(np.pad(off, ((0, 0), (0, 3))))})

    directions = widening._Directions(np.zeros((4, 3)), np.array([0, 2]), np.array([[0], [1]]))
    monkeypatch.setattr(widening, "uses_neighbourhoods", lambda problem: False)
    monkeypatch.setattr(widening, "_directions", lambda solution, order: directions)
    monkeypatch.setattr(widening, "_best_states", states)
    solution = SimpleNamespace(problem=None, state=SimpleNamespace(transforms={"base": at}))
    mean = sum(square.values())
    moments = np.outer(mean, mean) + 2 * sum(np.outer(each, each) for each in square.values()) + np.outer(mixed, mixed)
    found = curved_covariance(solution, ["base"])
    np.testing.assert_allclose(found[:3, :3], 4 * moments, rtol=1e-9)
    assert not found[3:].any()
    monkeypatch.setattr(widening, "_best_states", lambda *given: None)
    np.testing.assert_array_equal(curved_covariance(solution, ["base", "base"]), np.zeros((12, 12)))
    monkeypatch.setattr(
        widening, "_directions", lambda solution, order: directions._replace(wide=np.zeros(0, dtype=int))
    )
    np.testing.assert_array_equal(curved_covariance(solution, ["base", "base"]), np.zeros((12, 12)))
    monkeypatch.setattr(widening, "uses_neighbourhoods", lambda problem: True)
    np.testing.assert_array_equal(curved_covariance(solution, []), np.zeros((0, 0)))


def test_states_are_optimal_across_held_direction() -> None:
    """At a hundred sigmas along one held direction, the cost is optimal along the others."""
    steps = widening._directions(SOLUTION, [BASE]).steps
    sigmas = np.zeros((2, steps.shape[1]))
    sigmas[0, -1], sigmas[1, -2] = 100.0, -100.0
    problem = SOLUTION.noise.hold_sigmas(SOLUTION.problem)
    states = widening._best_states(SOLUTION, sigmas, steps)
    assert states is not None
    off = linearise(problem, states).gradient @ steps
    start = SOLUTION.state.repeat(problem, 2)
    straight = retract(problem, start, linearise(problem, SOLUTION.state), sigmas @ steps.T)
    before = linearise(problem, straight).gradient @ steps
    free = sigmas == 0
    assert np.abs(before[free]).max() > 1
    assert np.abs(off[free]).max() < 0.1 * np.abs(before[free]).max()
    name = BASE
    at = SOLUTION.state.transforms[name]
    moved = (at.inverse() @ states.transforms[name]).log()
    wanted = (sigmas @ steps.T)[:, SOLUTION.problem.columns[name]]
    assert np.linalg.norm(moved - wanted, axis=1).max() < 0.5 * np.linalg.norm(wanted, axis=1).min()


def test_all_pairs_of_wide_directions_are_mixed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pair of wide directions is used once.

    Directions with thin arcs beside the smallest sigma are omitted; at most eight are used.
    """
    sigmas = np.array([1e-4, 1.0, 2.0, 3.0, *np.linspace(4, 6, 6)])
    monkeypatch.setattr(widening, "linearise", lambda problem, state: SimpleNamespace(hessian=np.diag(sigmas**-2.0)))
    monkeypatch.setattr(widening, "column_scales", lambda *given: np.ones(10))
    noise = SimpleNamespace(hold_sigmas=lambda problem: problem, factor=1.0)
    problem = SimpleNamespace(columns={"base": slice(0, 10)})
    observability = SimpleNamespace(length_m=1.0)
    solution = SimpleNamespace(problem=problem, state=None, observability=observability, noise=noise)
    found = widening._directions(solution, ["base", "unknown"])
    assert found.steps.shape == (10, 10)
    assert found.wide.tolist() == list(range(2, 10))
    assert sorted(map(tuple, found.pairs.T.tolist())) == [(i, j) for i in range(8) for j in range(i + 1, 8)]
    np.testing.assert_allclose(np.linalg.norm(found.steps, axis=0), sigmas)
