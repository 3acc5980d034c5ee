"""Systematic errors put into simulated cells are found, with their size; clean cells have none."""

from dataclasses import replace

import numpy as np
import pytest
from tests.evidence import evidence_of

from basecal.accuracy.findings.systematic_error import systematic_error as findings
from basecal.accuracy.stated_sigmas import contradicted_sigmas
from basecal.accuracy.systematic_errors import search
from basecal.accuracy.systematic_errors.search import _reconciling, systematic_error
from basecal.accuracy.widening import widened
from basecal.cell import Recording, RobotState, Sample
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_packed
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

SCENARIO = Scenario(samples=40, position_m=0.3, spread_rad=0.8, robot_noise=(1e-4, 1e-4), target="pose")
SETTINGS = Settings(robot_noise="stated")
HALF = SCENARIO.samples // 2
MOST_SQUARED = 22.5  # of six freedoms: one in a thousand


def as_recorded(read, scenario=SCENARIO, seed=0):
    """A recording whose hand is read otherwise."""
    made = simulate(scenario, seed)
    samples = []
    for k, sample in enumerate(made.recording.samples):
        pose = sample.robots["hand"].base_from_flange
        robots = {**sample.robots, "hand": RobotState(read(k, pose))}
        samples.append(Sample(sample.sample, float(k), robots, sample.observations))
    return made.cell, Recording(tuple(samples))


def found_in(cell, recording):
    problem, _ = build_problem(cell, recording)
    solution = solve_packed(problem, cell, SETTINGS)
    stamps = {s.sample: s.stamp_s for s in recording.samples}
    return solution, systematic_error(solution, problem, stamps, SETTINGS)


def sagged(_, pose):
    """The hand bends by 20 mrad a metre, which it does not know."""
    turn = np.concatenate([np.zeros(3), np.cross(pose.translation, [0, 0, -0.02])])
    return SE3.exp(turn).inverse() @ pose


STEP = np.array([2e-3, 0, 0, 0, 0, 2e-3])
KINDS = {
    "length-scale": (lambda _, pose: SE3(pose.rotation, 1.005 * pose.translation), [-0.005], "too long"),
    "base-moved": (lambda k, pose: SE3.exp(STEP * (k >= HALF)) @ pose, STEP, "at about sample"),
    "drift": (lambda k, pose: SE3.exp(2 * STEP * k / 39) @ pose, 2 * STEP, "from the first sample to the last"),
    "deflection": (sagged, [-0.02], "mrad per metre"),
}


@pytest.mark.parametrize("code", KINDS)
def test_what_is_put_in_is_found(code):
    """The kind, whom it is about, and its size within four of its sigmas; the finding says so."""
    read, size, words = KINDS[code]
    cell, recording = as_recorded(read)
    solution, error = found_in(cell, recording)
    assert error is not None
    assert error.code == code
    assert error.about == ("hand" if len(size) < 6 else "eye_base_from_hand_base")
    sign = -1 if len(size) == 6 else 1  # what the poses are to be corrected by is against what they were read off by
    off = error.size - sign * np.asarray(size)
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(error.covariance)))
    if code == "base-moved":
        assert error.since is not None
        assert abs(error.since - HALF) <= 3
    evidence = evidence_of(cell, solution)
    (finding,) = findings(type(evidence)(**vars(evidence) | {"systematic_error": error}))
    assert (finding.code, finding.severity) == (code, "warning")
    assert words in finding.message


def test_the_error_that_gains_most_is_named_whatever_scores_best(monkeypatch):
    """A step is named as one where a drift of the same base is suspected after it, or before."""
    cell, recording = as_recorded(KINDS["base-moved"][0], replace(SCENARIO, state_robot_noise=False))
    problem, _ = build_problem(cell, recording)
    exact = solve_packed(problem, cell, SETTINGS)
    solution, stamps = with_noise(exact, Settings(), near=exact), {s.sample: s.stamp_s for s in recording.samples}
    suspects = search._suspects(search._situation(solution, problem, stamps))
    assert {"base-moved", "drift"} <= {each.candidate.code for each in suspects}
    for in_order in (suspects, suspects[::-1]):
        monkeypatch.setattr(search, "_suspects", lambda of, in_order=in_order: in_order)
        error = systematic_error(solution, problem, stamps, Settings())
        assert error is not None
        assert (error.code, error.about, error.is_certain) == ("base-moved", "eye_base_from_hand_base", True)


def test_the_covariance_covers_the_answer_without_the_error():
    """A step halfway moves the base by half of it, beyond its sigmas; the wider covariance holds both."""
    cell, recording = as_recorded(lambda k, pose: SE3.exp(3 * STEP * (k >= HALF)) @ pose)
    solution, error = found_in(cell, recording)
    assert error is not None
    made = simulate(SCENARIO, 0)
    base = "eye_base_from_hand_base"
    off = (solution.state.transforms[base].inverse() @ made.truth[base]).log()
    alone, both = (s.covariance_of([base]) for s in (solution, widened(solution, error.moved)))
    assert off @ np.linalg.solve(alone, off) > MOST_SQUARED
    assert off @ np.linalg.solve(both, off) < MOST_SQUARED


@pytest.mark.parametrize("seed", range(4))
def test_clean_cells_have_none(seed):
    """Nothing is found where nothing was put in."""
    cell, recording = as_recorded(lambda _, pose: pose, seed=seed)
    assert found_in(cell, recording)[1] is None


def on_a_path(lag_s, grows_s=0.0):
    """Poses of a hand on a path, and of what a world camera saw a moment before, which may grow to the end."""
    made = simulate(Scenario(samples=1, layout="eye_to_hand", target="pose"), 0)
    cell, first = made.cell, made.recording.samples[0]
    home = first.robots["arm"].base_from_flange
    rng = np.random.default_rng(0)
    phase, size = rng.uniform(0, 6, 6), np.repeat([0.1, 0.3], 3)

    def at(seconds):
        """Where the arm is."""
        return home @ SE3.exp(size * np.sin(0.4 * np.arange(1, 7) * seconds + phase))

    overhead_from_base = made.truth["arm_base_from_overhead"].inverse()
    flange_from_board = made.truth["arm_flange_from_board"]
    samples = []
    for k in range(50):
        seen = overhead_from_base @ at(0.2 * k - lag_s - grows_s * (k / 49 - 0.5)) @ flange_from_board
        noisy = seen @ SE3.exp(rng.standard_normal(6) * np.repeat([1e-3, 3e-3], 3))
        observed = type(first.observations[0])("overhead", "board", noisy, np.repeat([1e-3, 3e-3], 3))
        samples.append(Sample(k, 0.2 * k, {"arm": RobotState(at(0.2 * k))}, (observed,)))
    return cell, Recording(tuple(samples))


@pytest.mark.parametrize("lag_s", [0.0, 0.05])
def test_a_camera_that_lags(lag_s):
    """Its stamps less the lag are the arm's, within four sigmas; none without a lag."""
    cell, recording = on_a_path(lag_s)
    _, error = found_in(cell, recording)
    if not lag_s:
        assert error is None
        return
    assert error is not None
    assert (error.code, error.about, error.unit) == ("clock-offset", "overhead", "s")
    assert abs(error.size[0] + lag_s) < 4 * error.sigma
    assert error.sigma < 0.01


def test_a_camera_whose_clock_drifts():
    """By how much more it lags at the end than at the beginning, within four sigmas."""
    _, error = found_in(*on_a_path(0.0, 0.2))
    assert error is not None
    assert (error.code, error.about, error.unit) == ("clock-drift", "overhead", "s")
    assert abs(error.size[0] + 0.2) < 4 * error.sigma
    assert error.sigma < 0.03


def test_an_error_that_reconciles_residuals_with_their_sigmas():
    """Contradicted sigmas that an error explains are not estimated away; sigmas that are merely wrong are no error."""
    cell, moved = as_recorded(lambda k, pose: SE3.exp(4 * STEP * (k >= HALF)) @ pose)
    halved = []
    for sample in as_recorded(lambda _, pose: pose)[1].samples:
        (seen,) = sample.observations
        halved.append(replace(sample, observations=(replace(seen, sigma=0.5 * seen.sigma),)))
    for recording, code in ((moved, "base-moved"), (Recording(tuple(halved)), None)):
        problem, _ = build_problem(cell, recording)
        solution = solve_packed(problem, cell, SETTINGS)
        assert any(each.too_small for each in contradicted_sigmas(solution))
        found = _reconciling(solution, solution, problem, {s.sample: s.stamp_s for s in recording.samples}, SETTINGS)
        assert (None if found is None else found.code) == code


def test_robots_whose_kinematics_are_estimated():
    """A target that slipped in the hand is found, by as much, while joint offsets of the arms are estimated."""
    scenario = Scenario(samples=30, joints=True, joint_offset_rad=1e-3, joint_offsets="prior", target="pose")
    made = simulate(scenario, 1)
    slip = np.array([5e-3, 0, 0, 0, 0.02, 0])
    samples = list(made.recording.samples)
    for k in range(15, 30):
        (seen,) = samples[k].observations
        slipped = replace(seen, camera_from_target=seen.camera_from_target @ SE3.exp(slip))
        samples[k] = replace(samples[k], observations=(slipped,))
    solution, error = found_in(made.cell, Recording(tuple(samples)))
    assert solution.problem.models
    assert error is not None
    assert (error.code, error.about) == ("base-moved", "hand_flange_from_board")
    assert np.all(np.abs(error.size - slip) < 4 * np.sqrt(np.diag(error.covariance)))


def test_a_joint_that_is_off_is_found():
    """Joint 3 of the hand by 0.3 deg: which it is, its offset within four sigmas, and the wider covariance holds it."""
    made = simulate(Scenario(samples=40, joints=True, robot_noise=(1e-4, 1e-4)), 1)
    wrong, samples = np.radians(0.3), []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        off = replace(hand, joints_rad=hand.joints_rad - wrong * np.eye(6)[2])
        samples.append(replace(sample, robots={**sample.robots, "hand": off}))
    solution, error = found_in(made.cell, Recording(tuple(samples)))
    assert error is not None
    assert (error.code, error.about, error.joint) == ("joint-offset", "hand", 2)
    assert abs(error.size[0] - wrong) < 4 * error.sigma < 0.5 * wrong
    evidence = evidence_of(made.cell, solution)
    (finding,) = findings(type(evidence)(**vars(evidence) | {"systematic_error": error}))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    base = "eye_base_from_hand_base"
    off = (solution.state.transforms[base].inverse() @ made.truth[base]).log()
    alone, both = (s.covariance_of([base]) for s in (solution, widened(solution, error.moved)))
    assert off @ np.linalg.solve(alone, off) > MOST_SQUARED
    assert off @ np.linalg.solve(both, off) < MOST_SQUARED


def test_joints_that_are_all_off_are_found():
    """Offsets of all joints of which none alone explains much are told as what they are, and the answer is widened."""
    made = simulate(Scenario(samples=40, joints=True, robot_noise=(1e-4, 1e-4)), 3)
    wrong = np.radians(0.12) * np.random.default_rng(5).standard_normal(6)
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        off = replace(hand, joints_rad=hand.joints_rad - wrong)
        samples.append(replace(sample, robots={**sample.robots, "hand": off}))
    _, error = found_in(made.cell, Recording(tuple(samples)))
    assert error is not None
    assert (error.code, error.about, error.is_certain) == ("joint-offsets", "hand", True)
    # The first joint turns the base and the last one the target, both free: nothing is said of these.
    sigmas = np.sqrt(np.diag(error.covariance))
    np.testing.assert_array_less(np.abs(error.size - wrong)[1:5], 4 * sigmas[1:5])


def test_what_chance_may_make_is_kept_where_held_out_blocks_confirm_it(monkeypatch):
    """At a level that nothing reaches the same error is found, and said to be uncertain."""
    cell, recording = as_recorded(KINDS["length-scale"][0])
    _, certain = found_in(cell, recording)
    monkeypatch.setattr("basecal.accuracy.systematic_errors.search.CONFIRMED_SIGNIFICANCE", 0.0)
    with np.errstate(divide="ignore"):
        _, possible = found_in(cell, recording)
    assert certain is not None
    assert possible is not None
    assert (certain.is_certain, possible.is_certain) == (True, False)
    assert (possible.code, possible.about) == (certain.code, certain.about)
    np.testing.assert_array_equal(possible.moved, certain.moved)
