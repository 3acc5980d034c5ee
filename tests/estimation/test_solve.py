"""Tests of the solver against a slow, dense one, and of properties of any solution."""

from __future__ import annotations

import random
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests.motion_cells import SCARA, recorded, wobbling
from tests.oracles.dense import DenseProblem

from basecal.cell import Recording, Unknown
from basecal.effects import joint_offsets
from basecal.errors import InputError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import _is_plausible, integrate_solution, solve, solve_at_mode
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate
from basecal.simulation.shifts import simulate_shifts
from quick import quick

NOISY = (2e-4, 3e-4)
AGAINST_ORACLE = {
    "board, no robot noise": Scenario(samples=6, target="points"),
    "every arm at its own stop": Scenario(samples=6, target="points", robot_noise=NOISY),
    "eye still": Scenario(samples=6, target="points", arms="eye_still", camera_mount="fixed", robot_noise=NOISY),
    "half and half": Scenario(samples=6, target="points", arms="halves", robot_noise=NOISY),
    "light with priors": Scenario(
        samples=6, target="led", camera_mount="prior", target_mount="prior", base="prior", robot_noise=NOISY
    ),
    "poses": Scenario(samples=6, target="pose", robot_noise=NOISY),
    "camera on world": Scenario(samples=6, target="points", layout="eye_to_hand", robot_noise=NOISY),
}


def distance(estimate, truth) -> float:
    return float(np.abs((estimate.inverse() @ truth).log()).max())


@pytest.mark.journey
@pytest.mark.parametrize("name", quick(AGAINST_ORACLE, ["half and half", "light with priors"]))
def test_optimum_and_covariance_equal_the_dense_problem(name):
    """The elimination of stops has no effect: optimum to 1e-3 and covariance to 2 % of the sigmas.

    The oracle differentiates numerically and keeps second-order terms of stop errors in its Jacobian.
    """
    s = simulate(AGAINST_ORACLE[name], seed=3)
    ours = solve(s.cell, s.recording)
    dense = DenseProblem(s.cell, s.recording, ours.state.transforms, ours.state.stop_errors)
    transforms, covariance, cost = dense.solve()
    assert ours.cost == pytest.approx(cost, rel=1e-6)
    sigma = np.sqrt(np.diag(covariance))
    for name_, where in ours.problem.columns.items():
        xi = (
            ours.state.transforms[name_].inverse() @ type(ours.state.transforms[name_]).from_matrix(transforms[name_])
        ).log()
        assert np.all(np.abs(xi[: where.stop - where.start]) < 1e-3 * sigma[where])
    np.testing.assert_allclose(ours.covariance / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=0.02)


@pytest.mark.parametrize("arms", ["halves", "stations"])
def test_two_targets_of_a_sample_share_stop_errors(arms):
    """A second target that repeats every pixel does not reduce the sigma of the base much.

    Stops of both robots are shared.
    """
    s = simulate(Scenario(samples=6, target="points", arms=arms, robot_noise=NOISY, camera_mount="fixed"), seed=5)
    doubled = Recording(tuple(_repeat_views(x) for x in s.recording.samples))
    cell = replace(s.cell, targets={**s.cell.targets, "twin": replace(s.cell.targets["board"], name="twin")})
    ours = solve(cell, doubled)
    once = solve(s.cell, s.recording)
    # The twin repeats every pixel at its own free mount: the robot errors are not independent.
    assert (
        ours.transforms["eye_base_from_hand_base"].sigma_t.max()
        > 0.7 * once.transforms["eye_base_from_hand_base"].sigma_t.max()
    )
    assert (
        distance(ours.state.transforms["hand_flange_from_twin"], ours.state.transforms["hand_flange_from_board"]) < 1e-7
    )


def _repeat_views(sample):
    return replace(
        sample, observations=(*sample.observations, *(replace(o, target="twin") for o in sample.observations))
    )


@pytest.mark.parametrize("target", ["charuco", "led", "pose"])
def test_file_order_has_no_effect(target):
    """Shuffled samples give the same transforms to 1e-9 m and rad."""
    s = simulate(Scenario(samples=20, target=target, robot_noise=NOISY, arms="both"), seed=1)
    shuffled = list(s.recording.samples)
    random.Random(7).shuffle(shuffled)
    first, second = solve(s.cell, s.recording), solve(s.cell, Recording(tuple(shuffled)))
    assert all(distance(second.state.transforms[n], t) < 1e-9 for n, t in first.state.transforms.items())


def test_sample_numbers_have_no_effect():
    """Without robot noise, sample numbers are only names."""
    s = simulate(Scenario(samples=20, robot_noise=(0, 0)), seed=2)
    renumbered = tuple(replace(x, sample=100 - x.sample) for x in s.recording.samples)
    first, second = solve(s.cell, s.recording), solve(s.cell, Recording(renumbered))
    assert all(distance(second.state.transforms[n], t) < 1e-9 for n, t in first.state.transforms.items())


@pytest.mark.parametrize(
    "scenario",
    [
        Scenario(),
        Scenario(arms="halves"),
        Scenario(arms="stations"),
        Scenario(target="chessboard"),
        Scenario(target="points3d"),
        Scenario(target="pose"),
        Scenario(target="led"),
        Scenario(target="led", camera_mount="fixed", target_mount="fixed"),
        Scenario(layout="eye_in_hand"),
        Scenario(layout="eye_to_hand", target="led"),
        Scenario(layout="two_cameras"),
        Scenario(layout="two_world_cameras"),
        Scenario(layout="chain"),
        Scenario(intrinsics="free"),
        Scenario(intrinsics="prior"),
        Scenario(lens="fisheye", intrinsics="free"),
    ],
    ids=str,
)
def test_every_type_of_cell_is_solved_without_a_guess(scenario):
    """The truth is within each covariance: xi' C^-1 xi < 40, chance 5e-7 at 6 freedoms."""
    s = simulate(scenario, seed=11)
    solution = solve(s.cell, s.recording)
    assert solution.converged
    assert not solution.observability.unobservable
    for name, estimate in solution.transforms.items():
        where = solution.problem.columns.get(name)
        if where is None:
            continue
        width = where.stop - where.start
        xi = (estimate.mean.inverse() @ s.truth[name]).log()[:width]
        covariance = estimate.covariance[:width, :width]
        assert xi @ np.linalg.solve(covariance, xi) < 40


def test_unstated_pixel_sigma_is_estimated():
    """The estimate is one common factor, within 6 % of the truth (4 sigma of 2,142 degrees of freedom)."""
    s = simulate(Scenario(pixel_px=0.35, state_pixel_noise=False), seed=4)
    solution = solve(s.cell, s.recording)
    assert solution.noise.noise.pixel_px == pytest.approx(0.35, rel=0.06)
    stated = solve(replace(s.cell, pixel_px=solution.noise.noise.pixel_px), s.recording)
    np.testing.assert_allclose(solution.covariance, stated.covariance, rtol=1e-4, atol=1e-14)


def test_unstated_sigma_beside_stated_priors_is_estimated():
    """With priors and robot noise stated, the pixel sigma is estimated within 6 %."""
    s = simulate(Scenario(state_pixel_noise=False, target_mount="prior", robot_noise=(1e-4, 1e-4)), seed=4)
    solution = solve(s.cell, s.recording)
    assert solution.noise.converged
    assert solution.noise.noise.pixel_px == pytest.approx(0.2, rel=0.06)


def test_unstated_pose_sigmas_are_estimated_separately():
    """Translation and rotation of measured poses have a sigma each, within 15 %."""
    s = simulate(Scenario(samples=120, target="pose", pose_noise=(2e-3, 8e-3), state_observation_noise=False), seed=4)
    noise = solve(s.cell, s.recording).noise.noise
    assert noise.pose_m == pytest.approx(2e-3, rel=0.15)
    assert noise.pose_rad == pytest.approx(8e-3, rel=0.15)


def test_guess_is_used_on_request():
    """`start='guess'` needs a value for every transform, and then ends at the same optimum."""
    s = simulate(Scenario(), seed=6)
    with pytest.raises(InputError, match="needs a guess"):
        solve(s.cell, s.recording, Settings(start="guess", robot_noise="stated"))
    with_guesses = replace(
        s.cell,
        bases={"hand": Unknown("free", s.truth["eye_base_from_hand_base"])},
        cameras={"wrist": replace(s.cell.cameras["wrist"], mount=Unknown("free", s.truth["eye_flange_from_wrist"]))},
        targets={"board": replace(s.cell.targets["board"], mount=Unknown("free", s.truth["hand_flange_from_board"]))},
    )
    by_guess = solve(with_guesses, s.recording, Settings(start="guess", robot_noise="stated")).state.transforms
    assert all(distance(by_guess[n], t) < 1e-8 for n, t in solve(s.cell, s.recording).state.transforms.items())


def test_camera_and_target_on_one_flange_are_refused():
    """No robot moves one relative to the other."""
    s = simulate(Scenario(), seed=0)
    cell = replace(s.cell, targets={"board": replace(s.cell.targets["board"], on="eye")})
    with pytest.raises(InputError, match="both on 'eye'"):
        solve(cell, s.recording)


def test_joint_offsets_without_joints_are_refused():
    """A cell that requests joint offsets of a robot recorded by poses is refused.

    Otherwise the result would not contain them.
    """
    s, free = simulate(Scenario(), seed=0), joint_offsets.Stated(status="free")
    robots = {**s.cell.robots, "hand": replace(s.cell.robots["hand"], parameters={"joint_offsets": free})}
    with pytest.raises(InputError, match="its urdf and joints_rad in every sample are needed"):
        solve(replace(s.cell, robots=robots), s.recording)


@pytest.mark.parametrize(("start", "thorough"), [("closed", [False]), ("thorough", [True])])
def test_thorough_start_is_used_on_request(monkeypatch, start, thorough):
    """A cell that any start solves has a single start, with or without a search."""
    asked = []

    def first_state(problem, cell, thorough):
        asked.append(thorough)
        return State(s.truth, s.cameras, np.zeros((len(problem.stops), 6)))

    s = simulate(Scenario(samples=8), seed=0)
    monkeypatch.setattr("basecal.estimation.solve.first_state", first_state)
    assert solve(s.cell, s.recording, Settings(start=start, robot_noise="stated")).converged
    assert asked == thorough


def test_axis_shift_closed_form_starts_noisy_robots():
    """From it the descent ends where it ends from the truth."""
    camera = Camera("pinhole", [1000.0, 1000.0, 640.0, 480.0], (1280, 960))
    true = SE3.from_rotvec([0.1, 3.0, 0.3], [0.2, 0.1, 2.5])
    eye, hand = (SE3.exp(0.05 * np.random.default_rng(k).standard_normal((4, 6))) for k in range(2))
    s = simulate_shifts(true, eye, SE3.from_rotvec([0.2, 0.1, 0.0], [0.1, 0.05, 0.4]) @ hand, camera, 0.05, True, 0.05)
    robots = {name: replace(robot, noise=np.full(6, 1e-4)) for name, robot in s.cell.robots.items()}
    cell = replace(s.cell, robots=robots)
    found = solve(cell, s.recording, Settings(start="axis-shift", robot_noise="stated"))
    assert found.converged
    with_guesses = replace(cell, bases={"hand": Unknown("free", true)})
    by_truth = solve(with_guesses, s.recording, Settings(start="guess", robot_noise="stated")).state.transforms[
        "eye_base_from_hand_base"
    ]
    assert distance(found.state.transforms["eye_base_from_hand_base"], by_truth) < 1e-7


def test_known_sigmas_keep_the_observability_of_the_covariance(monkeypatch):
    """The covariance of a hand about one axis is a third wider than its noise suggests, if integration adds nothing.

    The addition by integration is unchanged, however much information data seem to have on hidden directions.
    """
    scenario = Scenario(samples=30, robot_noise=(2e-5, 2e-5), state_robot_noise=False, target_mount="prior")
    made = recorded(scenario, 0, hand=wobbling(SCARA, 1.5e-3))
    problem, _ = build_problem(made.cell, made.recording)
    found = solve_at_mode(problem, solve(made.cell, made.recording).state, Settings(robot_noise="estimated"))
    at_mode = np.linalg.inv(linearise(found.problem, found.state).hessian)
    sigma = np.sqrt(np.diag(at_mode))
    assert np.sqrt(np.diag(found.observability.inverse) / sigma**2).max() > 1.3
    for more in (0.0, 0.5):
        sure = replace(found.noise, covariance=(1 + more) * at_mode)
        monkeypatch.setattr("basecal.estimation.solve.integrate_sigmas", lambda *_, known=sure: known)
        added = (integrate_solution(found).covariance - found.observability.inverse) / np.outer(sigma, sigma)
        np.testing.assert_allclose(added, more * at_mode / np.outer(sigma, sigma), atol=1e-4)


def test_other_starts_are_tried_if_residuals_are_implausible():
    """The limit is between two and eight sigmas if all are stated, and between two and eight pixels if none is."""
    for stated in (True, False):
        made = simulate(Scenario(samples=4, state_pixel_noise=stated), 0)
        problem, _ = build_problem(made.cell, made.recording)
        dof = degrees_of_freedom(problem)
        assert _is_plausible(problem, 2.0**2 * dof)
        assert not _is_plausible(problem, 8.0**2 * dof)


@pytest.mark.parametrize(
    ("costs", "disputed"),
    [((8.0, 8.0 + 4e-6), False), ((8.0, 8.001), True), ((9.0, 8.0), True), ((np.nan, 8.0), True)],
)
def test_starts_with_different_ends_are_disputed(monkeypatch, costs, disputed):
    """The ends differ by more than a millionth of the cost. The lowest is used, never one without a cost."""
    ends = iter([("problem", cost, cost) for cost in costs])
    module = sys.modules["basecal.estimation.solve"]
    monkeypatch.setattr(module, "first_state", lambda *given, **options: "state")
    monkeypatch.setattr(module, "guessed_state", lambda *given: None)
    monkeypatch.setattr(module, "joint_state", lambda *given: None)
    monkeypatch.setattr(module, "_is_plausible", lambda problem, cost: False)
    monkeypatch.setattr(module, "_choose_readings", lambda *given: next(ends))
    assert module._start("problem", "cell", Settings()) == ("problem", np.nanmin(costs), disputed)


def test_implausible_start_is_followed_by_a_thorough_search(monkeypatch):
    """The second start is searched for thoroughly, and used if its residuals are smaller."""
    module = sys.modules["basecal.estimation.solve"]
    monkeypatch.setattr(module, "first_state", lambda problem, cell, thorough: 1.0 if thorough else 9.0)
    monkeypatch.setattr(module, "guessed_state", lambda *given: None)
    monkeypatch.setattr(module, "joint_state", lambda *given: None)
    monkeypatch.setattr(module, "_is_plausible", lambda problem, cost: False)
    monkeypatch.setattr(module, "_choose_readings", lambda problem, state, settings: (problem, state, state))
    assert module._start("problem", "cell", Settings()) == ("problem", 1.0, True)


def test_repr_of_a_solution_is_one_line():
    """The line has the estimated transforms, each with its sigmas, and the fit."""
    made = simulate(Scenario(samples=6, target="points", camera_mount="fixed"), 1)
    found = solve(made.cell, made.recording)
    base, mount = found.transforms["eye_base_from_hand_base"], found.transforms["hand_flange_from_board"]
    names = f"eye_base_from_hand_base {base.words()}; hand_flange_from_board {mount.words()}"
    assert repr(found) == f"<converged solution: {names}; chi-square {found.cost:.4g} of {found.dof}>"
    assert repr(replace(found, converged=False)).startswith("<unconverged solution: ")
