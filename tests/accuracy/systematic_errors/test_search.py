"""Tests of the search: simulated systematic errors are found with their size, and clean cells have none."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import f
from tests.evidence import evidence_of

from basecal.accuracy.covariance.widening import widen
from basecal.accuracy.findings.systematic_error import systematic_error as findings
from basecal.accuracy.stated_sigmas import contradicted_sigmas
from basecal.accuracy.systematic_errors import search
from basecal.accuracy.systematic_errors.place_scatter import PlaceScatter, Suspect
from basecal.accuracy.systematic_errors.search import _reconciling_effect, systematic_error
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Recording, RobotState, Sample
from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.effect import FoundEffect
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import integrate_solution, solve, solve_problem
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

SCENARIO = Scenario(samples=40, position_m=0.3, spread_rad=0.8, robot_noise=(1e-4, 1e-4), target="pose")
SETTINGS = Settings(robot_noise="stated")
NOISE = SimpleNamespace(logs=np.zeros(1), common={}, plain_minus_2_log_evidence=0.0, minus_2_log_evidence=0.0)
HALF = SCENARIO.samples // 2
MOST_SQUARED = 22.5  # chi-square with 6 freedoms, exceeded once in a thousand


def as_recorded(read, scenario=SCENARIO, seed=0):
    """A recording whose hand poses are changed by `read`."""
    made = simulate(scenario, seed)
    samples = []
    for k, sample in enumerate(made.recording.samples):
        pose = sample.robots["hand"].base_from_flange
        robots = {**sample.robots, "hand": RobotState(read(k, pose))}
        samples.append(Sample(sample.sample, float(k), robots, sample.observations))
    return made.cell, Recording(tuple(samples))


def find_effect(cell, recording):
    problem, _ = build_problem(cell, recording)
    solution = solve_problem(problem, cell, SETTINGS)
    stamps = {s.sample: s.stamp_s for s in recording.samples}
    return solution, systematic_error(solution, problem, stamps, SETTINGS)


def sag_pose(_, pose):
    """The hand bends by 20 mrad per metre without recording it."""
    turn = np.concatenate([np.zeros(3), np.cross(pose.translation, [0, 0, -0.02])])
    return SE3.exp(turn).inverse() @ pose


STEP = np.array([2.5e-3, 0, 0, 0, 0, 2.5e-3])
KINDS = {
    "length-scale": (lambda _, pose: SE3(pose.rotation, 1.005 * pose.translation), [-0.005], "too long"),
    "base-moved": (lambda k, pose: SE3.exp(STEP * (k >= HALF)) @ pose, STEP, "at about sample"),
    "drift": (lambda k, pose: SE3.exp(2 * STEP * k / 39) @ pose, 2 * STEP, "from the first sample to the last"),
    "deflection": (sag_pose, [-0.02], "mrad per metre"),
}


@pytest.mark.parametrize("code", KINDS)
def test_simulated_effect_is_found(code):
    """The effect is found with its kind, its device, and its size within four sigmas; the finding reports it."""
    read, size, words = KINDS[code]
    cell, recording = as_recorded(read)
    solution, error = find_effect(cell, recording)
    assert error is not None
    assert error.code == code
    assert error.about == ("hand" if len(size) < 6 else "eye_base_from_hand_base")
    sign = -1 if len(size) == 6 else 1  # the correction has the opposite sign of the reading error
    off = error.size - sign * np.asarray(size)
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(error.covariance)))
    if code == "base-moved":
        assert error.since is not None
        assert abs(error.since - HALF) <= 3
    evidence = evidence_of(cell, solution)
    (finding,) = findings(type(evidence)(**vars(evidence) | {"systematic_error": error}))
    assert (finding.code, finding.severity) == (code, "warning")
    assert words in finding.message


@pytest.mark.journey
def test_effect_with_largest_gain_is_named(monkeypatch):
    """The effect with the largest gain is named, in any order of scores: a step, not a drift of the same base."""
    cell, recording = as_recorded(KINDS["base-moved"][0], replace(SCENARIO, state_robot_noise=False))
    problem, _ = build_problem(cell, recording)
    exact = solve_problem(problem, cell, SETTINGS)
    solution, stamps = with_noise(exact, Settings(), guess=exact), {s.sample: s.stamp_s for s in recording.samples}
    suspects = search._suspects(search.situate(solution, problem, stamps))
    assert {"base-moved", "drift"} <= {each.candidate.code for each in suspects}
    first = suspects[: search._MOST_TRIED]
    for in_order in (first, first[::-1]):
        monkeypatch.setattr(search, "_suspects", lambda of, in_order=in_order: in_order)
        error = systematic_error(solution, problem, stamps, Settings())
        assert error is not None
        assert (error.code, error.about, error.is_certain) == ("base-moved", "eye_base_from_hand_base", True)


def test_covariance_covers_answer_without_effect():
    """A step halfway moves the base by half of it, beyond its sigmas; the wider covariance covers both."""
    cell, recording = as_recorded(lambda k, pose: SE3.exp(3 * STEP * (k >= HALF)) @ pose)
    solution, error = find_effect(cell, recording)
    assert error is not None
    made = simulate(SCENARIO, 0)
    base = "eye_base_from_hand_base"
    off = (solution.state.transforms[base].inverse() @ made.truth[base]).log()
    alone, both = (s.joint_transform_covariance([base]) for s in (solution, widen(solution, error.moved)))
    assert off @ np.linalg.solve(alone, off) > MOST_SQUARED
    assert off @ np.linalg.solve(both, off) < MOST_SQUARED


@pytest.mark.parametrize("seed", range(4))
def test_clean_cells_have_no_effect(seed):
    """No effect is found in clean cells."""
    cell, recording = as_recorded(lambda _, pose: pose, seed=seed)
    assert find_effect(cell, recording)[1] is None


def record_path(lag_s, grows_s=0.0):
    """Poses of a hand on a path and of what a world camera saw earlier, by a lag that may grow."""
    made = simulate(Scenario(samples=1, layout="eye_to_hand", target="pose"), 0)
    cell, first = made.cell, made.recording.samples[0]
    home = first.robots["arm"].base_from_flange
    rng = np.random.default_rng(0)
    phase, size = rng.uniform(0, 6, 6), np.repeat([0.1, 0.3], 3)

    def at(seconds):
        """The arm's pose at a time."""
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
def test_camera_lag_is_found(lag_s):
    """A camera lag is found within four sigmas; without a lag there is no effect."""
    cell, recording = record_path(lag_s)
    _, error = find_effect(cell, recording)
    if not lag_s:
        assert error is None
        return
    assert error is not None
    assert (error.code, error.about, error.unit) == ("clock-offset", "overhead", "s")
    assert abs(error.size[0] + lag_s) < 4 * error.sigma
    assert error.sigma < 0.01


def test_camera_clock_drift_is_found():
    """A camera clock drift is found: the lag grows by 0.2 s over the recording, within four sigmas."""
    _, error = find_effect(*record_path(0.0, 0.2))
    assert error is not None
    assert (error.code, error.about, error.unit) == ("clock-drift", "overhead", "s")
    assert abs(error.size[0] + 0.2) < 4 * error.sigma
    assert error.sigma < 0.03


def test_effect_reconciles_contradicted_sigmas():
    """Contradicted sigmas explained by an effect are not estimated away; merely wrong sigmas give no effect."""
    cell, moved = as_recorded(lambda k, pose: SE3.exp(4 * STEP * (k >= HALF)) @ pose)
    halved = []
    for sample in as_recorded(lambda _, pose: pose)[1].samples:
        (seen,) = sample.observations
        halved.append(replace(sample, observations=(replace(seen, sigma=0.5 * seen.sigma),)))
    for recording, code in ((moved, "base-moved"), (Recording(tuple(halved)), None)):
        problem, _ = build_problem(cell, recording)
        solution = solve_problem(problem, cell, SETTINGS)
        assert any(each.is_too_small for each in contradicted_sigmas(solution))
        stamps = {sample.sample: sample.stamp_s for sample in recording.samples}
        found = _reconciling_effect(solution, solution, problem, stamps, SETTINGS)
        assert (None if found is None else found.code) == code


def test_slipped_target_is_found_beside_joint_offsets():
    """A target that slipped in the hand is found with its size while joint offsets of the arms are estimated."""
    scenario = Scenario(samples=30, joints=True, joint_offset_rad=1e-3, joint_offsets="prior", target="pose")
    made = simulate(scenario, 1)
    slip = np.array([5e-3, 0, 0, 0, 0.02, 0])
    samples = list(made.recording.samples)
    for k in range(15, 30):
        (seen,) = samples[k].observations
        slipped = replace(seen, camera_from_target=seen.camera_from_target @ SE3.exp(slip))
        samples[k] = replace(samples[k], observations=(slipped,))
    solution, error = find_effect(made.cell, Recording(tuple(samples)))
    assert solution.problem.models
    assert error is not None
    assert (error.code, error.about) == ("base-moved", "hand_flange_from_board")
    assert np.all(np.abs(error.size - slip) < 4 * np.sqrt(np.diag(error.covariance)))


def test_single_joint_offset_is_found():
    """An offset of 0.3 deg of joint 3 is found within four sigmas, and the wider covariance covers it."""
    made = simulate(Scenario(samples=40, joints=True, robot_noise=(1e-4, 1e-4)), 1)
    wrong, samples = np.radians(0.3), []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        off = replace(hand, joints_rad=hand.joints_rad - wrong * np.eye(6)[2])
        samples.append(replace(sample, robots={**sample.robots, "hand": off}))
    solution, error = find_effect(made.cell, Recording(tuple(samples)))
    assert error is not None
    assert (error.code, error.about, error.joint) == ("joint-offset", "hand", 2)
    assert abs(error.size[0] - wrong) < 4 * error.sigma < 0.5 * wrong
    evidence = evidence_of(made.cell, solution)
    (finding,) = findings(type(evidence)(**vars(evidence) | {"systematic_error": error}))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    base = "eye_base_from_hand_base"
    off = (solution.state.transforms[base].inverse() @ made.truth[base]).log()
    alone, both = (s.joint_transform_covariance([base]) for s in (solution, widen(solution, error.moved)))
    assert off @ np.linalg.solve(alone, off) > MOST_SQUARED
    assert off @ np.linalg.solve(both, off) < MOST_SQUARED


def test_offsets_of_all_joints_are_found():
    """Offsets of all joints, of which none alone explains much, are found as such, and the answer is widened."""
    made = simulate(Scenario(samples=40, joints=True, robot_noise=(1e-4, 1e-4)), 3)
    wrong = np.radians(0.12) * np.random.default_rng(5).standard_normal(6)
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        off = replace(hand, joints_rad=hand.joints_rad - wrong)
        samples.append(replace(sample, robots={**sample.robots, "hand": off}))
    _, error = find_effect(made.cell, Recording(tuple(samples)))
    assert error is not None
    assert (error.code, error.about, error.is_certain) == ("joint-offsets", "hand", True)
    # The first joint rotates the base and the last one the target; both are free and compensate these offsets.
    sigmas = np.sqrt(np.diag(error.covariance))
    np.testing.assert_array_less(np.abs(error.size - wrong)[1:5], 4 * sigmas[1:5])


def test_uncertain_effect_needs_held_out_confirmation(monkeypatch):
    """At a level that no effect reaches, the same confirmed effect is found as uncertain."""
    cell, recording = as_recorded(KINDS["length-scale"][0])
    _, certain = find_effect(cell, recording)
    monkeypatch.setattr(search, "discoveries", lambda doubts, tests, share: np.zeros(len(doubts), dtype=bool))
    _, possible = find_effect(cell, recording)
    assert certain is not None
    assert possible is not None
    assert (certain.is_certain, possible.is_certain) == (True, False)
    assert (possible.code, possible.about) == (certain.code, certain.about)
    np.testing.assert_array_equal(possible.moved, certain.moved)


def candidates(code, *about, since=None):
    return Candidates(code, about, since or (None,) * len(about), "m", (np.zeros((2, len(about), 6, 1)),))


def find_suspects(monkeypatch, *kinds):
    """Suspects among candidates with such log chances; sizes are numbered, each with two freedoms."""
    chances = {id(kind): np.array(logs) for kind, logs in kinds}

    def scored(_, kind, largest):
        """Replacement of `score` with known chances."""
        logs = chances[id(kind)]
        return SimpleNamespace(
            log_chance=logs,
            statistic=-2 * logs,
            size=np.arange(len(logs))[:, None],
            freedoms=np.full(len(logs), 2, dtype=np.int64),
        )

    effects = {
        str(k): SimpleNamespace(candidates=lambda of, kind=kind: iter([kind])) for k, (kind, _) in enumerate(kinds)
    }
    monkeypatch.setattr(search, "EFFECTS", effects | {"": SimpleNamespace(candidates=None)})
    monkeypatch.setattr(search, "score", scored)
    return search._suspects(SimpleNamespace(linearisation=None, null_model=lambda effect, about: None))


def test_most_unlikely_candidate_of_each_code_and_name_is_suspected(monkeypatch):
    """The most unlikely candidate of each code and name is suspected.

    Its chance counts all candidates of its code, in all rows; a chance expected of so many is none.
    """
    steps = candidates("step", "a", "a", "b", since=(4, 6, 8))
    more = candidates("step", "c")
    found = find_suspects(monkeypatch, (steps, [-10.0, -12.0, -5.2]), (more, [-5.4]))
    assert [each.candidate.about for each in found] == [("a",), ("c",)]
    first, second = found
    assert (first.candidate.since, first.size.tolist(), first.freedoms) == ((6,), [1], 2)
    assert (first.log_count, first.log_chance) == pytest.approx((np.log(4), -12.0 + np.log(4)))
    assert (second.log_count, second.log_chance) == pytest.approx((np.log(4), -5.4 + np.log(4)))
    (earlier,) = find_suspects(monkeypatch, (candidates("step", "a", "a", since=(4, 6)), [-12.0, -10.0]))
    assert (earlier.candidate.since, earlier.size.tolist()) == ((4,), [0])


def test_suspects_need_chance_of_one_in_fifty(monkeypatch):
    """Suspects need a chance below one in fifty; of two tests of a code, one in a hundred each."""
    for chance, count in ((0.021, 0), (0.019, 1)):
        assert len(find_suspects(monkeypatch, (candidates("drift", "a"), [np.log(chance)]))) == count
    for chance, count in ((0.0105, 0), (0.0095, 1)):
        assert len(find_suspects(monkeypatch, (candidates("drift", "a", "b"), [np.log(chance), 0.0]))) == count


@pytest.mark.parametrize(("chance", "first"), [(-11.35, "step"), (-11.4, "drift")])
def test_many_candidates_cost_half_log_of_number(monkeypatch, chance, first):
    """A candidate among many costs half the logarithm of their number.

    Of four steps that is log 2, so the best is before or behind a single drift.
    """
    steps = candidates("step", "a", "a", "a", "a", since=(3, 4, 5, 6))
    found = find_suspects(monkeypatch, (steps, [0, -12.07, 0, 0]), (candidates("drift", "a"), [chance]))
    assert found[0].candidate.code == first
    assert len(found) == 2


def test_suspects_are_sorted_by_chance(monkeypatch):
    """Suspects are sorted, the most unlikely first."""
    found = find_suspects(monkeypatch, (candidates("drift", *"abcde"), [-20.0, -30.0, -25.0, -10.0, -40.0]))
    assert [each.candidate.about[0] for each in found] == ["e", "b", "c", "a", "d"]


def test_three_suspects_are_solved_at_most(monkeypatch):
    """At most three suspects are solved, the most unlikely first.

    One that moves the data exactly as an earlier one is skipped.
    """
    every = [make_suspect(about=name) for name in "abcde"]
    monkeypatch.setattr(
        search, "_remaining_chi_square", lambda of, one, other: (0.0, int(one.candidate.about[0] != "b"))
    )
    assert [each.candidate.about[0] for each in search._select_suspects(None, every)] == ["a", "c", "d"]


def make_suspect(
    code="drift", log_chance=-20.0, log_count=0.0, about="arm", moves=(None,), size=(0.5,), joint=(), since=None
):
    candidate = Candidates(code, (about,), (since,), "m", moves, joint)
    likely = (np.array(size), len(size), -2 * log_chance, log_chance, log_chance, log_count)
    return Suspect(code, candidate, *likely, family=10)


def make_solution(plain, logs=True):
    """A solution of such evidence, and half of it with a random effect."""
    noise = SimpleNamespace(
        logs=np.zeros(1) if logs else None, plain_minus_2_log_evidence=plain, minus_2_log_evidence=plain / 2, common={}
    )
    return SimpleNamespace(noise=noise)


@pytest.mark.parametrize("name", ["", "smooth"])
def test_gain_uses_residual_freedoms(monkeypatch, name):
    """The chance of a gain uses the residual freedoms: two of forty are those of the effect.

    The evidence includes the random effect beside it, before and after the effect is removed.
    """
    error = make_suspect(size=(0.5, 0.1), log_count=1.5)
    of = SimpleNamespace(
        random_effect=lambda effect, about: name,
        linearisation=SimpleNamespace(residual_freedoms=40.0),
        is_held_in_time=lambda effect: False,
    )
    after = {}
    monkeypatch.setattr(search, "_without_suspect", lambda solution, of, error: solution)
    monkeypatch.setattr(search, "_minus_2_log_evidence", lambda solution, name: after[name])

    def chance(before, left, **changed):
        """Log chance of the gain from one evidence to another."""
        after[name] = left / (2 if name else 1)
        return search._log_chance(of, error, search._gain(of, error, make_solution(before, **changed)))

    gain = 50.0 if name else 100.0
    assert chance(130.0, 30.0) == pytest.approx(f.logsf(38 / 2 * np.expm1(gain / 40), 2, 38) + 1.5)
    assert chance(30.0, 130.0) == 1.5  # no gain
    assert chance(130.0, 30.0, logs=False) == 1.5  # noise was not estimated, so there is no evidence


@dataclass(frozen=True)
class Solved:
    """A solution with only a problem."""

    problem: Problem


def test_removing_effect_moves_views_by_its_size():
    """Removing an effect moves each view by its moves times the sizes; groups without moves stay."""
    made = simulate(Scenario(samples=4), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    problem = problem.with_groups([group, group])
    of = Situation(problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))), problem, {})
    moves = 1e-2 * np.random.default_rng(1).standard_normal((4, 1, 6, 2))
    error = make_suspect(moves=(moves, None), size=(0.4, -0.7))
    moved, same = search._without_suspect(Solved(problem), of, error).problem.groups
    before, after = (of.state.camera_from_target(g, problem.stops) for g in (group, moved))
    np.testing.assert_allclose((before.inverse() @ after).log(), moves[:, 0] @ error.size, atol=1e-12)
    assert same is problem.groups[1]


@dataclass(frozen=True)
class Described:
    """The fields of a solution that the description of an effect reads."""

    problem: str
    noise: NoiseEstimate
    state: str = "state"


@pytest.mark.parametrize(
    ("code", "about", "is_camera", "is_target"),
    [
        ("length-scale", "arm", False, False),
        ("clock-offset", "wrist", True, False),
        ("drift", "board", False, True),
    ],
)
def test_effect_description_names_its_device(monkeypatch, code, about, is_camera, is_target):
    """The description names the device of the effect.

    Its size is corrected by the remainder beside the same random effects, its covariance is from its information.
    """
    again = SimpleNamespace(size=np.array([[0.25]]), information=np.array([[[4.0]]]))
    monkeypatch.setattr(search, "situate", lambda solution, *of: SimpleNamespace(null_model=lambda *of: solution))
    given = "corrected", {"smooth": {}}
    before = Described("before", NoiseEstimate(Noise(), 1.0, (), True, common=given[1]), "start")
    after = Described("corrected", replace(before.noise, common={}))
    monkeypatch.setattr(
        search, "score", lambda null, *of: again if (null.problem, null.noise.common) == given else None
    )
    monkeypatch.setattr(search, "state_step", lambda problem, *states: states)
    groups = (SimpleNamespace(camera="wrist", target="board"), SimpleNamespace(camera="other", target="board"))
    problem = SimpleNamespace(groups=groups)
    of = SimpleNamespace(problem=problem, recorded=None, stamps={})
    found = search._describe(of, make_suspect(code, about=about, joint=(3,), since=7), before, after)
    assert (found.code, found.about, found.since, found.unit, found.joint) == (code, about, 7, "m", 3)
    assert (found.is_camera, found.is_target) == (is_camera, is_target)
    assert (found.size.tolist(), found.covariance.tolist(), found.sigma) == ([0.75], [[0.25]], 0.5)
    assert found.moved == ("start", "state")
    assert search._describe(of, make_suspect(about=about), before, after).joint is None


ERROR = FoundEffect("drift", "drift", "arm", False, False, None, "", np.zeros(1), np.eye(1), np.zeros(6))


def search_effects(monkeypatch, suspects, gains=None, models=(), refuted=(), **solution):
    """The described suspect, its size, and whether it is certain; `gains` and `refuted` are by name."""
    described = []

    def describe(of, error, before, after):
        """Replacement of `_describe` that records its arguments."""
        described.append((error.candidate.about[0], error.size.tolist(), before.name, after.name))
        return ERROR

    monkeypatch.setattr(search, "situate", lambda *given: SimpleNamespace(is_held_in_time=lambda effect: False))
    monkeypatch.setattr(search, "_suspects", lambda of: list(suspects))
    monkeypatch.setattr(
        search, "_confirmed_suspects", lambda of, tried: iter([e for e in tried if e.candidate.about[0] not in refuted])
    )
    monkeypatch.setattr(
        search, "_without_suspect", lambda whole, of, error: SimpleNamespace(name=error.candidate.about[0])
    )
    monkeypatch.setattr(search, "_solve_again", lambda whole, settings: SimpleNamespace(name=f"{whole.name} again"))
    monkeypatch.setattr(search, "_log_chance", lambda of, error, before: (gains or {}).get(error.candidate.about[0], 0))
    monkeypatch.setattr(search, "_gain", lambda of, error, before: 0.0)
    monkeypatch.setattr(search, "_describe", describe)
    monkeypatch.setattr(search, "_select_suspects", lambda of, every: every)
    monkeypatch.setattr(search, "_alternatives", lambda of, chosen, every: ())
    usual = {"converged": True, "cost": 1.0, "name": "answer", "noise": NOISE}
    problem = SimpleNamespace(groups=(1,), models=models)
    found = systematic_error(SimpleNamespace(**usual | {"problem": problem} | solution), None, {}, SETTINGS)
    assert len(described) == (found is not None)
    return None if found is None else (*described[0], found.is_certain)


def test_best_suspect_by_score_or_gain_is_chosen(monkeypatch):
    """The most unlikely suspect by score or gain is chosen, of those that held-out blocks confirm.

    Each is solved without itself; one of many costs half their number's logarithm.
    """
    pair = make_suspect(about="a", log_chance=-20.0), make_suspect(about="b", log_chance=-21.0)
    assert search_effects(monkeypatch, pair) == ("b", [0.5], "answer", "b again", True)
    assert search_effects(monkeypatch, pair, {"a": -22.0})[0] == "a"
    assert search_effects(monkeypatch, pair, {"b": -10.0})[0] == "b"
    assert search_effects(monkeypatch, pair, refuted="b")[0] == "a"
    assert search_effects(monkeypatch, pair, refuted="ab") is None
    assert search_effects(monkeypatch, ()) is None
    of_many = make_suspect(about="a", log_chance=-20.0, log_count=2.1)
    assert search_effects(monkeypatch, (of_many, pair[1]))[0] == "a"
    assert search_effects(monkeypatch, (make_suspect(about="a", log_chance=-20.0, log_count=1.9), pair[1]))[0] == "b"


def test_certain_effect_precedes_change_explained_by_places(monkeypatch):
    """A certain effect comes before a change in time that places may explain; alone, the change is uncertain."""
    moved = replace(make_suspect(about="a", log_chance=-30.0), scatter=PlaceScatter(5.0, 40.0))
    assert search_effects(monkeypatch, (moved, make_suspect(about="b", log_chance=-20.0)))[0] == "b"
    assert search_effects(monkeypatch, (moved,))[::4] == ("a", False)
    assert search_effects(monkeypatch, (replace(moved, scatter=PlaceScatter()),))[::4] == ("a", True)


@pytest.mark.parametrize(("chance", "is_certain"), [(2.4e-4, True), (6e-4, False)])
def test_one_false_discovery_in_four_hundred_is_allowed(monkeypatch, chance, is_certain):
    """One false discovery in four hundred is allowed, so with ten codes a chance of one in four thousand is certain.

    A larger one may be chance; with estimated kinematics it is not reported and corrects nothing.
    """
    possible = make_suspect(about="a", log_chance=np.log(chance))
    assert search_effects(monkeypatch, [possible])[-1] == is_certain
    found = search_effects(monkeypatch, [possible, make_suspect(about="b", log_chance=-30.0)], models=("arm",))
    assert found == ("a" if is_certain else "b", [0.0], "answer", "answer", True)
    assert (search_effects(monkeypatch, [possible], models=("arm",)) is not None) == is_certain


def test_failed_solution_has_no_effect(monkeypatch):
    """A failed solution has no effect, nor one without views or with infinite cost."""
    some = [make_suspect()]
    assert search_effects(monkeypatch, some) is not None
    for changed in ({"converged": False}, {"cost": np.inf}, {"problem": SimpleNamespace(groups=(), models=())}):
        assert search_effects(monkeypatch, some, **changed) is None


@pytest.mark.parametrize(
    ("first", "second", "has_shared", "found"),
    [
        ("certain", "certain", True, "first"),
        ("likely", "certain", True, "second"),
        ("likely", "likely", True, "first"),
        ("likely", None, True, "first"),
        ("likely", "certain", False, "first"),
        (None, "likely", True, "second"),
        (None, None, True, None),
        (None, "certain", False, None),
    ],
)
def test_running_error_is_first_certain_effect(monkeypatch, first, second, has_shared, found):
    """The running error is the first certain effect.

    Beside shared stop errors, only effects that these may contain are tested again.
    """
    effects = [
        None if kind is None else SimpleNamespace(name=name, is_certain=kind == "certain")
        for name, kind in (("first", first), ("second", second))
    ]
    confirmed = iter(effects)
    asked = []
    of = SimpleNamespace(linearisation="alone", null="beside")
    monkeypatch.setattr(search, "situate", lambda solution, stamps: of)
    monkeypatch.setattr(search, "Situation", lambda *given: "again")
    monkeypatch.setattr(search, "without_errors", lambda held, state: state)
    monkeypatch.setattr(search, "_suspects", lambda situation: ["alone", "beside"])
    monkeypatch.setattr(search, "_null_model", lambda situation, suspect: suspect)
    monkeypatch.setattr(
        search, "_confirm_first", lambda solution, situation, suspects: asked.append(suspects) or next(confirmed)
    )
    beside = SimpleNamespace(hold_sigmas=lambda problem: problem) if has_shared else None
    problem = SimpleNamespace(groups=(1,), models=())
    solution = SimpleNamespace(converged=True, problem=problem, state=None, noise=SimpleNamespace(beside_common=beside))
    error = search.running_error(solution, {})
    assert (None if error is None else error.name) == found
    assert asked in ([["alone", "beside"]], [["alone", "beside"], ["alone"]])
    for changed in ({"converged": False}, {"problem": SimpleNamespace(groups=(), models=())}):
        assert search.running_error(SimpleNamespace(**vars(solution) | changed), {}) is None
    estimated = SimpleNamespace(groups=(1,), models=("arm",))
    assert search.running_error(SimpleNamespace(**vars(solution) | {"problem": estimated}), {}) is None


@pytest.mark.parametrize(
    ("effect", "kind", "about", "gain", "is_contained"),
    [
        ("joint_offsets", "joint_offsets", "arm", 10.1, True),
        ("joint_offsets", "joint_offsets", "arm", 9.9, False),
        ("joint_offsets", "joint_offsets", "other", 10.1, False),
        ("joint_offsets", "smooth", "arm", 10.1, False),
        ("drift", "joint_offsets", "arm", 10.1, False),
    ],
)
def test_joint_random_effect_contains_joint_errors(effect, kind, about, gain, is_contained):
    """A joint random effect contains joint errors of the same robot if its evidence is very strong."""
    noise = SimpleNamespace(common={kind: {about: None}}, plain_minus_2_log_evidence=gain, minus_2_log_evidence=0.0)
    suspected = replace(make_suspect(), effect=effect)
    assert search._is_contained(SimpleNamespace(noise=noise), suspected) is is_contained


def test_effect_moves_answer_as_its_correction():
    """To first order, an effect moves the answer as solving the corrected recording does."""
    cell, recording = as_recorded(lambda _, pose: SE3(pose.rotation, 1.005 * pose.translation))
    problem, _ = build_problem(cell, recording)
    solution = solve_problem(problem, cell, SETTINGS)
    situation = search.situate(solution, problem, {})
    length = next(each for each in search._suspects(situation) if each.candidate.code == "length-scale")
    found = search._to_first_order(situation, length)
    corrected = search._without_suspect(solution, situation, replace(length, size=found.size))
    after = search.solve_from(corrected.problem, solution.state, SETTINGS)
    step = search.state_step(problem, solution.state, after.state)
    sigma = np.sqrt(np.diag(solution.covariance))
    assert np.abs(step / sigma).max() > 1
    np.testing.assert_allclose(found.moved / sigma, step / sigma, atol=0.1 * np.abs(step / sigma).max())
    assert (found.about, found.since, found.is_camera) == ("hand", None, False)


def one_robot(read):
    """Effect found for a robot that carries a camera over a board, with changed poses."""
    made = simulate(replace(SCENARIO, layout="eye_in_hand"), 0)
    samples = [
        replace(s, robots={"arm": RobotState(read(k, s.robots["arm"].base_from_flange))}, stamp_s=float(k))
        for k, s in enumerate(made.recording.samples)
    ]
    return find_effect(made.cell, Recording(tuple(samples)))[1]


def test_lengths_of_robot_and_target_are_not_distinguished():
    """Lengths of one robot and its target move the data equally, with opposite signs."""
    error = one_robot(lambda _, pose: SE3(pose.rotation, 1.005 * pose.translation))
    (other,) = error.alternatives
    assert {error.about, other.about} == {"arm", "board"}
    np.testing.assert_allclose(error.size, -other.size, rtol=1e-3)
    assert error.is_target != other.is_target


@pytest.mark.parametrize("factor", [0.8, 4])
def test_distinguishable_effects_have_no_alternatives(factor):
    """A small step in the middle of a recording may be a drift; a large one has no alternatives."""
    cell, recording = as_recorded(lambda k, pose: SE3.exp(factor * STEP * (k >= HALF)) @ pose)
    _, error = find_effect(cell, recording)
    assert error.code == "base-moved"
    assert ("drift" in {each.code for each in error.alternatives}) == (factor < 1)


@pytest.mark.journey
def test_link_errors_are_not_reported_as_joints():
    """Link errors that stops evidently share contain what joints do by chance.

    They are neither reported nor counted twice.
    """
    arms = Scenario(samples=30, joints=True, link_error=(5e-4, 5e-4), robot_noise=(5e-5, 1e-4))
    made = simulate(replace(arms, state_robot_noise=False, state_pixel_noise=False), 0)
    solution = solve(made.cell, made.recording, Settings(robot_noise="estimated"))
    assert systematic_error(solution, solution.problem, {}, Settings()) is None


@pytest.mark.journey
def test_gear_ratio_of_small_rotation_keeps_alternative():
    """A gear ratio of a joint that hardly rotates is not reported as offsets alone.

    Random offsets hold most of the effect of a joint at 1.66 +- 0.27 rad that rotates 0.26 % too far.
    """
    unstated = Scenario(samples=40, joints=True, state_robot_noise=False, state_pixel_noise=False)
    made = simulate(replace(unstated, robot_noise=(5e-5, 1e-4), position_m=0.25), 5031)
    samples = []
    for sample in made.recording.samples:
        joints = np.array(sample.robots["hand"].joints_rad)
        joints[4] *= 1 - 0.0026
        robots = {**sample.robots, "hand": RobotState(joints_rad=joints)}
        samples.append(Sample(sample.sample, float(sample.sample), robots, sample.observations))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    solution = integrate_solution(with_noise(solve_problem(problem, made.cell, Settings()), Settings()))
    error = systematic_error(solution, problem, {s.sample: s.stamp_s for s in samples}, Settings())
    assert "gear_ratio" in {each.effect for each in (error, *error.alternatives)}
