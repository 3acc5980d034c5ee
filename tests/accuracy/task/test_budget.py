"""Tests of the error budget: sums of sources, and gains of halving them, compared with trials."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.task import budget as module
from basecal.accuracy.task.budget import NOISE_SOURCE, SHARED_SOURCE, _entry, budget, calibration_budget, error_sources
from basecal.accuracy.task.meeting import Meeting, make_meeting
from basecal.cell import Recording
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve
from basecal.simulation import Scenario, simulate

POINT = (0.5, 0.1, 0.3)
NOBODY = SimpleNamespace(weight=None, stop_variances=dict)
PRIORS = Scenario(
    samples=15,
    robot_noise=(1e-4, 2e-4),
    camera_mount="prior",
    intrinsics="prior",
    joints=True,
    joint_offset_rad=1e-3,
    joint_offsets="prior",
)


def at(made, solution: Solution, name: str) -> tuple[Meeting, float]:
    meeting = make_meeting(made.cell, solution.problem, solution.state, name, np.array([POINT]))
    return meeting, meeting.mean_square_m2(solution.covariance)


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize(
    "scenario",
    [
        Scenario(samples=12, target="pose", robot_noise=(1e-4, 2e-4)),
        Scenario(samples=15, target="pose", arms="stations", robot_noise=(1e-4, 2e-4)),
        PRIORS,
    ],
    ids=["poses", "stops shared by views", "priors"],
)
def test_sources_add_to_total(scenario, seed):
    """Sources add to the covariance's own variance within 0.1 %, without a remainder.

    Halving one gains three quarters of its variance and more, as the others weigh less then; halving all leaves a
    quarter.
    """
    made = simulate(scenario, seed)
    solution = solve(made.cell, made.recording)
    task, total = at(made, solution, "eye_base_from_hand_base")
    entries = budget(solution, task, total, {})
    assert {entry.source for entry in entries}.isdisjoint({NOISE_SOURCE}) or entries[-1].share < 1e-3
    assert sum(entry.rms_m**2 for entry in entries) == pytest.approx(total, rel=1e-3)
    assert sum(entry.share for entry in entries) == pytest.approx(1.0, rel=1e-3)
    for entry in entries:
        assert 0.249 * total < entry.halved_rms_m**2 < 1.001 * total - 0.75 * entry.rms_m**2


def test_additions_are_sources(of_poses):
    """A widening has its own line and is quartered when halved; the remainder is attributed to the sigmas."""
    made, solution, _ = of_poses
    task, total = at(made, solution, "eye_base_from_hand_base")
    entries = {e.source: e for e in budget(solution, task, 3 * total, {"clocks": total})}
    assert entries["clocks"].share == pytest.approx(1 / 3)
    assert entries["clocks"].halved_rms_m ** 2 == pytest.approx(2.25 * total)
    assert entries[NOISE_SOURCE].share == pytest.approx(1 / 3, rel=1e-2)


HALVED = {
    "views of wrist": {"pose_noise": (5e-4, 1.5e-3)},
    "repeatability of arm": {"robot_noise": (4e-4, 1.25e-3)},
}


@pytest.mark.slow
@pytest.mark.parametrize("source", HALVED)
def test_halving_source_reduces_error_as_predicted(source):
    """Halving a source reduces the true error as predicted, within 10 %, over 150 cells.

    Robot and view errors are equally large. The draws are the same with the whole sigma and half of it, so that chance
    leaves about 4 % of the ratio.
    """
    scenario = Scenario(samples=12, target="pose", layout="eye_in_hand", robot_noise=(8e-4, 2.5e-3))
    halved = replace(scenario, **HALVED[source])
    predicted, found = np.zeros(2), np.zeros(2)
    for seed in range(150):
        whole, half = simulate(scenario, seed), simulate(halved, seed)
        solutions = solve(whole.cell, whole.recording), solve(half.cell, half.recording)
        task, total = at(whole, solutions[0], "arm_base_from_board")
        entry = next(e for e in budget(solutions[0], task, total, {}) if e.source == source)
        predicted += [total, entry.halved_rms_m**2]
        found += [error_m2(made.truth, each) for made, each in zip((whole, half), solutions, strict=True)]
    ratio = np.sqrt(predicted[1] / predicted[0])
    assert ratio < 0.9  # the source matters
    assert np.sqrt(found[1] / found[0]) == pytest.approx(ratio, rel=0.1)


def error_m2(truth, solution: Solution) -> float:
    """Squared error of the point under the calibration [m^2]."""
    true, found = truth["arm_base_from_board"], solution.state.transforms["arm_base_from_board"]
    return float(np.sum((found @ true.inverse() @ np.array(POINT) - POINT) ** 2))


@pytest.mark.journey
def test_calibration_with_task_has_budget():
    """A calibration with a task has a budget that adds up to the base's error at the task, with estimated noise.

    Without a task there is none.
    """
    made = simulate(Scenario(samples=15, robot_noise=(1e-4, 2e-4), state_robot_noise=False), 4)
    calibration = calibrate(made.cell, made.recording, Settings(task_point=POINT))
    total = calibration.meeting.variance_m2
    assert sum(entry.rms_m**2 for entry in calibration.budget) == pytest.approx(total, rel=1e-6)
    assert {e.source for e in calibration.budget} >= {"views of wrist", "repeatability of eye", "repeatability of hand"}
    assert calibrate(made.cell, made.recording).budget is None


@pytest.fixture(scope="module")
def of_poses():
    """A cell with the noise of its poses stated, its solution, and its calibration for the task."""
    made = simulate(Scenario(samples=12, target="pose", robot_noise=(1e-4, 2e-4)), 3)
    settings = Settings(task_point=POINT)
    return made, solve(made.cell, made.recording), calibrate(made.cell, made.recording, settings)


@pytest.mark.parametrize("common", [{}, {"smooth": {"eye": np.array([1e-4, 1e-4])}}])
def test_remainder_is_named_by_estimate(of_poses, common):
    """The remainder is named as the uncertainty of the noise, or of shared errors if robot poses have them."""
    made, solution, calibration = of_poses
    total = at(made, solution, "eye_base_from_hand_base")[1]
    wide = replace(calibration.meeting, sigma_m=np.sqrt(total))  # three times the variance
    solution = replace(solution, noise=replace(solution.noise, common=common))
    found = calibration_budget(made.cell, replace(calibration, meeting=wide), solution, {}, np.array([POINT]))
    shares = {entry.source: entry.share for entry in found}
    assert shares[SHARED_SOURCE if common else NOISE_SOURCE] == pytest.approx(2 / 3, rel=1e-2)
    assert len({NOISE_SOURCE, SHARED_SOURCE} & shares.keys()) == 1
    nothing = replace(calibration, transforms={})
    assert calibration_budget(made.cell, nothing, solution, {}, np.array([POINT])) is None


@pytest.fixture(scope="module")
def of_priors():
    made = simulate(PRIORS, 3)
    solution = solve(made.cell, made.recording)
    return solution, *at(made, solution, "eye_base_from_hand_base")


def test_prior_share_is_that_of_its_information(of_priors):
    """A prior's share is J C W C J'.

    W is the information of the prior alone, C the covariance, and J the derivative of the meeting by base and arms.
    """
    solution, task, total = of_priors
    name = "eye_flange_from_wrist"
    where, sigma = solution.problem.columns[name], solution.problem.unknowns[name].sigma
    by_prior = solution.covariance[:, where] @ np.diag(sigma**-2.0) @ solution.covariance[where]
    own = np.trace(task.weight @ by_prior)
    (entry,) = [each for each in budget(solution, task, total, {}) if each.source == f"prior of {name}"]
    assert entry.rms_m == pytest.approx(np.sqrt(own), rel=3e-3)
    assert entry.share == pytest.approx(own / total, rel=6e-3)


def test_sources_shrink_with_total(of_priors):
    """If the total is half, the variance of each source is half, and halving one gains the same share.

    The largest is first.
    """
    solution, task, total = of_priors
    whole, half = (budget(solution, task, of, {}) for of in (total, total / 2))
    assert [entry.source for entry in half] == [entry.source for entry in whole if entry.source != NOISE_SOURCE]
    assert sum(entry.rms_m**2 for entry in half) == pytest.approx(total / 2, rel=1e-9)
    for before, after in zip(whole, half, strict=False):
        assert after.share == pytest.approx(before.share, rel=2e-3)
        assert after.halved_rms_m == pytest.approx(before.halved_rms_m / np.sqrt(2), rel=2e-3)
    sizes = [entry.rms_m for entry in half]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize(("variance", "gain", "left"), [(4.0, 3.0, 13.0**0.5), (4.0, 17.0, 0.0)])
def test_entry_has_root_share_and_remainder(variance, gain, left):
    """An entry has the root, the share of sixteen, and the error left after the gain; the gain is at most the total."""
    found = _entry("views", variance, 16.0, gain)
    assert (found.source, found.rms_m, found.share, found.halved_rms_m) == ("views", 2.0, 0.25, pytest.approx(left))


@pytest.mark.parametrize(("left", "is_reported"), [(0.9e-4, False), (1.1e-4, True)])
def test_remainder_above_ten_thousandth_is_reported(monkeypatch, left, is_reported):
    """A remainder above one ten-thousandth is reported, and loses three quarters if halved.

    Sources without error have no line.
    """
    monkeypatch.setattr(module, "_variance", lambda *given: 1.0)
    monkeypatch.setattr(module, "error_sources", lambda problem: [])
    solution = SimpleNamespace(problem=None, state=None)
    found = budget(solution, NOBODY, 1.0, {"clocks": 1.0 - left, "nothing": 0.0}, "rest")
    assert [entry.source for entry in found] == (["clocks", "rest"] if is_reported else ["clocks"])
    assert not is_reported or found[1].halved_rms_m ** 2 == pytest.approx(1 - 0.75 * left)


def test_share_is_derivative_by_log_variance(monkeypatch):
    """A share is the derivative by the log variance of a part that grows with its squared sigma.

    Halving it gains three quarters.
    """
    part = SimpleNamespace(name="part", scale_sigma=lambda problem, state, factor: (factor, None))
    monkeypatch.setattr(module, "_variance", lambda solution, weight, problem, state: 3.0 * problem**2 + 2.0)
    monkeypatch.setattr(module, "error_sources", lambda problem: [part])
    (found, rest) = budget(SimpleNamespace(problem=1.0, state=None), NOBODY, 5.0, {}, "rest")
    assert found.rms_m**2 == pytest.approx(3.0, rel=1e-3)
    assert found.halved_rms_m**2 == pytest.approx(5.0 - 0.75 * 3.0)
    assert rest.rms_m**2 == pytest.approx(2.0, rel=1e-3)


EVERYTHING = Scenario(
    samples=12,
    robot_noise=(1e-4, 2e-4),
    camera_mount="prior",
    intrinsics="prior",
    joints=True,
    joint_offset_rad=1e-3,
    joint_offsets="prior",
)


@pytest.fixture(scope="module")
def solution():
    made = simulate(EVERYTHING, 3)
    return solve(made.cell, made.recording)


def test_every_source_has_name(solution):
    """Views, stops of robots, and each kind of prior have a source name."""
    assert [source.name for source in error_sources(solution.problem)] == [
        "views of wrist",
        "repeatability of eye",
        "repeatability of hand",
        "prior of eye_flange_from_wrist",
        "lens of wrist",
        "kinematics of eye",
        "kinematics of hand",
    ]


def test_sources_together_scale_covariance(solution):
    """With every sigma doubled the information is a quarter, to rounding: no source is missing."""
    problem, state = solution.problem, solution.state
    before = linearise(problem, state).hessian
    for source in error_sources(problem):
        problem, state = source.scale_sigma(problem, state, 2.0)
    after = linearise(problem, state).hessian
    np.testing.assert_allclose(4 * after, before, rtol=0, atol=1e-7 * np.abs(before).max())


def test_scaled_source_keeps_state(solution):
    """A scaled source keeps stop errors in metres, so every view is predicted as before."""
    (source,) = [each for each in error_sources(solution.problem) if each.name == "repeatability of eye"]
    problem, state = source.scale_sigma(solution.problem, solution.state, 3.0)
    (group,) = problem.groups
    before = solution.state.camera_from_target(group, solution.problem.stops)
    np.testing.assert_allclose(state.camera_from_target(group, problem.stops).matrix, before.matrix, atol=1e-14)


def test_source_scales_its_device_only():
    """A source scales only the views of its camera, the stops of its robot, or its own prior."""
    made = simulate(EVERYTHING, 3)
    twin = replace(made.cell.cameras["wrist"], name="second")
    cell = replace(made.cell, cameras={**made.cell.cameras, "second": twin})
    samples = [
        replace(s, observations=(*s.observations, *(replace(o, camera="second") for o in s.observations)))
        for s in made.recording.samples
    ]
    problem, _ = build_problem(cell, Recording(tuple(samples)))
    state = State({}, {}, np.zeros((len(problem.stops), 6)))
    scaled = {source.name: source.scale_sigma(problem, state, 2.0)[0] for source in error_sources(problem)}
    assert {"views of second", "prior of eye_flange_from_second", "lens of second"} <= scaled.keys()
    for name, other in scaled.items():
        weights = {f"views of {g.camera}": g.measurement.weight for g in problem.groups}
        after = {f"views of {g.camera}": g.measurement.weight for g in other.groups}
        for each, weight in weights.items():
            np.testing.assert_allclose(after[each], weight / (2.0 if each == name else 1.0))
        for robot in ("eye", "hand"):
            mine = np.array(problem.stops.robot) == robot
            factor = 2.0 if name == f"repeatability of {robot}" else 1.0
            np.testing.assert_allclose(other.stops.sigma[mine], factor * problem.stops.sigma[mine])
        for unknown, of in problem.unknowns.items():
            if of.sigma is not None:
                factor = 2.0 if name == f"prior of {unknown}" else 1.0
                np.testing.assert_allclose(other.unknowns[unknown].sigma, factor * of.sigma)
        for camera, lens in problem.lenses.items():
            factor = 2.0 if name == f"lens of {camera}" else 1.0
            np.testing.assert_allclose(other.lenses[camera].sigma, factor * lens.sigma)


def test_halves_are_computed_by_source(monkeypatch):
    """Halving an addition or the remainder leaves a quarter of its variance; likewise the stops at the task."""
    scaled = SimpleNamespace(name="views of wrist", scale_sigma=lambda problem, state, factor: ("views", factor))
    stops = SimpleNamespace(name="repeatability of eye", scale_sigma=lambda problem, state, factor: ("stops", factor))
    variances = {("all", None): 10.0, ("views", 0.5): 6.0, ("stops", 0.5): 9.0}
    monkeypatch.setattr(module, "error_sources", lambda problem: iter([scaled, stops]))
    monkeypatch.setattr(module, "_variance", lambda solution, weight, problem, state: variances[problem, state])
    monkeypatch.setattr(module, "source_variance", lambda solution, weight, source: 5.0 if source is scaled else 1.0)
    meeting = SimpleNamespace(weight=None, stop_variances=lambda: {"eye": (1.0, 7.0)})
    found = {
        each.source: each for each in budget(SimpleNamespace(problem="all", state=None), meeting, 20.0, {"bends": 8.0})
    }
    shares = {"bends": 8.0, "views of wrist": 5.0, "repeatability of eye": 4.0, NOISE_SOURCE: 3.0}
    gains = {"bends": 6.0, "views of wrist": 4.0, "repeatability of eye": 1 + 2.25, NOISE_SOURCE: 2.25}
    assert list(found) == list(shares)
    for name, entry in found.items():
        assert entry.share == pytest.approx(shares[name] / 20)
        assert entry == _entry(name, shares[name], 20.0, gains[name])


def test_variance_scales_with_noise_factor(of_priors):
    """Variances scale with the estimated noise factor, as the covariance of the answer does."""
    solution = of_priors[0]
    weight = np.eye(solution.problem.width)
    more = replace(solution, noise=replace(solution.noise, factor=3 * solution.noise.factor))
    ours, theirs = (module._variance(each, weight, solution.problem, solution.state) for each in (solution, more))
    assert theirs == pytest.approx(3 * ours)
