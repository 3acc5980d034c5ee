"""Mix-ups are named, symmetries are told, and clean cells left alone; `benchmarks.mutations` is the whole matrix."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.declared import declared
from tests.shared.mutate import lines_of, mutations, recording_of
from tests.shared.real_recordings import example, nao_cell
from tests.shared.rewriting import exchanged, inverted, resized, with_robots, with_targets

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.input_check import conventions
from basecal.accuracy.input_check.hypotheses import ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_choice import TriedHypothesis
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.input_check.loop_fit import LoopFit
from basecal.errors import BasecalError, DatasetError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

STATED = Settings(robot_noise="stated")
BOARD = simulate(Scenario(samples=20), 7)
POSES = simulate(Scenario(samples=20, target="pose"), 7)
LIGHT = simulate(Scenario(samples=24, target="led", camera_mount="fixed", target_mount="fixed"), 7)


def mixed_up(made, name):
    """What `calibrate` finds after the mix-up of that name."""
    each = next(m for m in mutations(made.cell, lines_of(made.recording), 0) if m.name.startswith(name))
    return calibrate(each.cell, recording_of(each.lines(lines_of(made.recording)), each.cell))


def named(calibration):
    return {(f.code, f.about) for f in calibration.findings if f.severity == "error"}


@pytest.mark.parametrize(
    ("made", "name", "code", "about"),
    [
        (BOARD, "eye inverted", "robot-pose-inverted", ("eye",)),
        (BOARD, "robots in mm", "length-unit", ("eye", "hand")),
        (BOARD, "everything in mm", "length-unit", ("eye", "hand")),
        pytest.param(BOARD, "target times", "board-size", ("board",), marks=pytest.mark.slow),  # as in mistakes
        pytest.param(BOARD, "focal length", "intrinsics", ("wrist",), marks=pytest.mark.slow),
        (POSES, "target mirrored", "mirrored", ()),
        (LIGHT, "eye in mm", "length-unit", ("eye",)),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                (BOARD, "eye and hand inverted", "robot-pose-inverted", ("eye", "hand")),
                (BOARD, "eye and hand swapped", "robots-swapped", ("eye", "hand")),
                (BOARD, "hand w x y z", "quaternion-order", ("hand",)),
                (BOARD, "seen one late", "pairing-shifted", ()),
                (BOARD, "a detection missed", "pairing-shifted", ()),
                (POSES, "target in", "target-pose-inverted", ()),
                (POSES, "targets in mm", "length-unit", ()),
                (LIGHT, "hand inverted", "robot-pose-inverted", ("hand",)),
            )
        ),
    ],
)
def test_a_mix_up_is_named(made, name, code, about):
    """The finding holds the code and the names, and nothing is given for good."""
    calibration = mixed_up(made, name)
    assert (code, about) in named(calibration)
    assert calibration.verdict == "refused"


def none_survives(*given):
    """As `_screen_hypotheses`: it asks for no fit and has no hypothesis."""
    yield from ()
    return []


@pytest.mark.parametrize("look", ["quick", pytest.param("none", marks=pytest.mark.slow)])
def test_exchanged_joints_are_named(look, monkeypatch):
    """Two arms of one model: also where a mount is known by a prior, and no loop closes without it."""
    if look == "none":
        monkeypatch.setattr(conventions, "_screen_hypotheses", none_survives)
    made = simulate(Scenario(samples=12, joints=True, target_mount="prior"), 3)
    found = calibrate(made.cell, exchanged(made.recording, "eye", "hand"))
    assert named(found) == {("robots-swapped", ("eye", "hand"))}
    assert "The joints of eye and hand are exchanged" in found.findings[0].message


@pytest.mark.parametrize("made", [BOARD, POSES, LIGHT])
def test_clean_cells_are_left_alone(made):
    """Two arms that turn freely: no other reading comes near, and the verdict is good."""
    assert calibrate(made.cell, made.recording).verdict == "good"


@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_links_explain_no_mix_up(factor):
    """Arms by joints, whose links are estimated: no mix-up is suspected, and a size that is wrong is found."""
    scenario = Scenario(samples=16, joints=True, link_error=(5e-4, 1e-3), link_parameters="prior")
    made = simulate(scenario, 7)
    cell = resized(made.cell, {"board": factor})
    problem, _ = build_problem(cell, made.recording)
    plain = solve_problem(problem, cell, STATED)
    found = conventions.check_conventions(cell, made.recording, problem, plain, STATED, False)
    assert [f.code for f in found] == (["board-size"] if factor > 1 else [])


@pytest.mark.slow
def test_exchanged_robots_and_an_inverted_target_are_one():
    """A target whose z points to the camera stays before it when inverted: both mix-ups fit alike and both are named.

    Turns are measured so well that noise does not tell the two ends of a pose apart.
    """
    made = simulate(Scenario(samples=20, target="pose", pose_noise=(1e-3, 1e-5)), 7)
    half = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
    towards_the_camera = with_targets(made.recording, lambda poses: poses @ half)
    found = named(calibrate(made.cell, with_targets(towards_the_camera, inverted)))
    assert {code for code, _ in found} - {"unobservable-direction"} == {"target-pose-inverted", "robots-swapped"}


def test_a_still_arm_by_poses_is_ambiguous():
    """Its one pose may be inverted, which no data could tell: listed, with how to tell, and no doubt."""
    made = simulate(Scenario(samples=15, arms="eye_still", camera_mount="fixed"), 0)
    calibration = calibrate(made.cell, made.recording)
    (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
    assert (calibration.verdict, finding.severity) == ("good", "info")
    assert "robot-pose-inverted" in finding.message
    assert "Turn eye" in finding.message


@pytest.mark.slow
def test_nao_and_its_twin_are_ambiguous():
    """The head's poses inverted fit as well and put the base 0.58 m away: said of the recording and of its twin."""
    try:
        cell, recording = nao_cell()
    except DatasetError as error:
        pytest.skip(str(error))
    for told in (recording, with_robots(recording, {"eye": inverted})):
        calibration = calibrate(cell, told)
        (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
        assert calibration.verdict == "doubtful"
        assert "the poses of eye are inverted" in finding.message


def test_rct_with_a_wrong_fixed_lens_names_it():
    """The guess that ships with the recording, 1400 px and no distortion, stated as fixed: `intrinsics`."""
    cell, recording = example("rct_charuco")
    camera = cell.cameras["camera"]
    lens = Camera("pinhole", np.array([1400.0, 1400.0, 800.0, 600.0, 0, 0, 0, 0, 0]), camera.size_px)
    fixed = replace(camera, intrinsics=replace(camera.intrinsics, status="fixed", camera=lens))
    found = calibrate(replace(cell, cameras={"camera": fixed}), recording)
    assert "intrinsics" in {f.code for f in found.findings}
    assert found.verdict != "good"
    right = calibrate(cell, recording)
    assert "intrinsics" not in {f.code for f in right.findings}
    assert right.verdict != "refused"


def test_a_reading_that_leaves_the_answer_is_not_mentioned():
    """A camera alone moves and the board lies on the world: a chessboard's half turn moves nothing but its mount."""
    made = simulate(Scenario(samples=15, layout="eye_in_hand", target="chessboard"), 0)
    assert calibrate(made.cell, made.recording).verdict == "good"


def test_a_size_off_by_a_thousandth_is_no_mix_up():
    """What hardly improves the fit is not named, though it moves the answer."""
    made = simulate(Scenario(samples=20, robot_noise=(3e-4, 5e-4)), 1)
    found = calibrate(resized(made.cell, {"board": 1.001}), made.recording)
    assert "board-size" not in {f.code for f in found.findings}


@pytest.mark.slow
def test_poses_that_fit_nothing_are_not_good():
    """Observed poses disturbed by half a metre and radian fit no reading: none is named, and it is not good."""
    rng = np.random.default_rng(0)
    made = simulate(Scenario(samples=20, target="pose", state_observation_noise=False), 0)
    wild = with_targets(made.recording, lambda poses: poses @ SE3.exp(0.5 * rng.normal(size=(len(poses), 6))))
    found = calibrate(made.cell, wild)
    assert found.verdict != "good"
    assert {f.code for f in found.findings} <= {"poor-fit", "unobservable-direction", "not-converged"}


@pytest.mark.parametrize(("samples", "can"), [(5, False), (6, True)])
def test_two_of_three_folds_leave_more_equations_than_unknowns(samples, can):
    """Of measured poses, six equations each for 18 unknowns: by a quarter more from six of them."""
    made = simulate(Scenario(samples=samples, target="pose"), 0)
    assert conventions._can_hold_out(build_problem(made.cell, made.recording)[0]) == can


def hypothesis(words, code="length-unit", about=("eye",), is_wider=False):
    """One that changes nothing."""
    return ConventionHypothesis(code, about, words, "", "", lambda reading: reading, is_wider)


def surviving(monkeypatch, offs, among=None, is_led=False, made=BOARD):
    """Words of those that survive a quick look by which views of each are so far off, the declared one first."""
    fits = [{("wrist", "board"): LoopFit((), np.full(4, off), is_led)} if off is not None else {} for off in offs]
    inputs_seen = []

    def screened(inputs, lenses):
        """As `_screened`, with fits that are known."""
        inputs_seen.extend(inputs)
        yield from ()
        return fits

    monkeypatch.setattr(conventions, "_fit_readings", screened)
    among = among or [hypothesis(str(k)) for k in range(1, len(offs))]
    (found,) = conventions._run_checks([conventions._screen_hypotheses(declared(made.cell, made.recording), {}, among)])
    return [each.words for each, _ in found], len(inputs_seen)


@pytest.mark.parametrize(
    ("offs", "is_led", "words"),
    [
        ((0.02, 0.071, 0.069, 0.01), False, ["3"]),  # three times the best and 0.01 rad are 0.04
        ((0.1, 0.3, 0.29, 0.32, 0.2), False, ["4", "2", "1"]),
        ((0.26, 0.24), False, ["1"]),
        ((0.26, 0.26), False, []),
        ((0.02, None), False, []),
        ((0.01, 0.031, 0.033), True, ["1"]),  # of a light the floor is 0.002 rad
        ((0.06, 0.049), True, ["1"]),
        ((0.06, 0.051), True, []),
    ],
)
def test_hypotheses_that_close_loops_about_as_well_as_the_best_are_fitted(monkeypatch, offs, is_led, words):
    """Within three times the best and a floor, the best first; none where even the best leaves loops open."""
    assert surviving(monkeypatch, offs, is_led=is_led) == (words, len(offs))


def test_no_more_than_eight_hypotheses_are_fitted(monkeypatch):
    """The best of them."""
    words, _ = surviving(monkeypatch, [0.02, *np.linspace(0.03, 0.02, 12)])
    assert words == [str(k) for k in range(12, 4, -1)]


def test_what_a_quick_look_cannot_tell_is_left_out_of_it(monkeypatch):
    """Wider models, and samples paired one late with robots that never move."""
    late = [hypothesis("both", "pairing-shifted", ("eye", "hand")), hypothesis("hand", "pairing-shifted", ("hand",))]
    among = [hypothesis("wider", is_wider=True), *late, hypothesis("exchanged", about=("eye", "hand"))]
    still = simulate(Scenario(samples=6, arms="eye_still"), 0)
    assert surviving(monkeypatch, [0.02] * 3, among, made=still) == (["hand", "exchanged"], 3)


@pytest.mark.parametrize(("off", "facts", "explains"), [
    (np.full(10, 0.01), (), True),
    (np.repeat([0.01, 0.1], [7, 3]), (), False),  # a session of three samples stays unexplained
    (np.full(10, 0.01), ("a fact",), False),
])  # fmt: skip
def test_what_leaves_a_session_unexplained_ends_no_search(off, facts, explains):
    """A hypothesis that explains all and contradicts no fact does."""
    solution = SimpleNamespace(converged=True, cost=1.0, noise=SimpleNamespace(estimated=("pose_m",)))
    tried = TriedHypothesis(hypothesis("inverted"), HypothesisFit(solution, off, np.arange(10), False), facts)
    assert conventions._explains_all(tried) is explains


def test_a_hypothesis_is_out_of_the_race_at_twice_the_declared_error(monkeypatch):
    """So much it is told that its error may be; nothing is fitted where a fact stands against it."""
    limits = []
    monkeypatch.setattr(conventions, "fit_hypothesis", lambda *given: limits.append(given[-1]))
    whole = HypothesisFit(None, np.full(10, 0.03), np.arange(10), True)
    given, as_is = declared(BOARD.cell, BOARD.recording), TriedHypothesis(hypothesis("declared"), whole, ())
    assert conventions._fit_fully(given, hypothesis("other"), STATED, None, as_is) == []
    assert limits == [pytest.approx(0.06)]
    monkeypatch.setattr(conventions, "impossible_reading", lambda *given: ("a fact",))
    assert conventions._fit_fully(given, hypothesis("other"), STATED, None, as_is) == []
    assert len(limits) == 1


@pytest.mark.parametrize(("equations", "enough"), [(6, False), (33, False), (34, True), (100, True)])
def test_two_thirds_of_the_samples_need_a_quarter_more_equations_than_unknowns(equations, enough):
    """Of 18 unknowns 22.5 must be left in two folds: 34 equations leave 22.7, one less is too few."""
    measurement = SimpleNamespace(equations=lambda: np.array([equations - 3, 3]))
    problem = SimpleNamespace(groups=(SimpleNamespace(measurement=measurement),), width=18)
    assert conventions._can_hold_out(problem) == enough


def test_what_closes_loops_is_known_by_the_declared_fit_of_a_light(monkeypatch):
    """A hypothesis of poses beside it is held to a light's limits."""
    fits = [{("wrist", "board"): LoopFit((), np.full(4, off), light)} for off, light in ((0.06, True), (0.055, False))]

    def screened(inputs, lenses):
        """As `_screened`, with fits that are known."""
        yield from ()
        return fits

    monkeypatch.setattr(conventions, "_fit_readings", screened)
    assert ended(conventions._screen_hypotheses(declared(BOARD.cell, BOARD.recording), {}, [hypothesis("other")])) == []


def ended(check):
    """What a check that asks for nothing ends with."""
    with pytest.raises(StopIteration) as end:
        next(check)
    return end.value.value


def test_checks_in_step_get_their_own_answers(monkeypatch):
    """One asks twice, one never, one once for two pairs; each is told the fits of what it asked for."""
    asked = []
    monkeypatch.setattr(conventions, "fit_loops", lambda pairs: asked.append(pairs) or [f"fit of {p}" for p in pairs])

    def check(*wanted):
        """Asks for these, one after the other."""
        told = []
        for each in wanted:
            told.append((yield each))
        return told

    found = conventions._run_checks([check(["a"], ["b"]), check(), check(["c", "d"])])
    assert found == [[["fit of a"], ["fit of b"]], [], [["fit of c", "fit of d"]]]
    assert asked[:2] == [["a", "c", "d"], ["b"]]


def test_cells_of_many_robots_are_checked_pair_by_pair(monkeypatch):
    """Eight at a time go side by side, in their order, and what they find is brought together."""
    pairs = [SimpleNamespace(reading=f"reading {k}", state=k) for k in range(17)]
    told, parts, steps = [], [], []
    in_step = conventions._run_checks

    def checked(reading, state, settings, explained):
        """Finds the number of the pair."""
        told.append((reading, explained))
        yield from ()
        return (state,)

    monkeypatch.setattr(conventions, "has_many_robots", lambda problem: True)
    monkeypatch.setattr(conventions, "solve_single_pairs", lambda *given: pairs)
    monkeypatch.setattr(conventions, "merge_findings", lambda pairs, found: found)
    monkeypatch.setattr(conventions, "declared_reading", lambda *given: "whole")
    monkeypatch.setattr(conventions, "_check_reading", checked)
    monkeypatch.setattr(conventions, "_run_checks", lambda checks: steps.append(len(checks)) or in_step(checks))
    settings = SimpleNamespace(report_progress=lambda at, count: parts.append((at, count)))
    given = (BOARD.cell, BOARD.recording, None, SimpleNamespace(state=None), settings)
    assert conventions.check_conventions(*given, False) == [(k,) for k in range(17)]
    assert told == [(f"reading {k}", False) for k in range(17)]
    assert (steps, parts) == ([8, 8, 1], [(0, 17), (8, 17), (16, 17)])


def fit_of(core=0.01, good=True, tail=False, explained=True, best=False):
    """A fit by what is asked of it."""
    solution = SimpleNamespace(state="known", problem=None)
    return SimpleNamespace(trimmed_rms=core, good=good, tail=tail, explained=explained, best=best, solution=solution)


@pytest.fixture
def judged_by_name(monkeypatch):
    """Fits of `fit_of` are judged by what they say of themselves."""
    monkeypatch.setattr(conventions, "is_plausible", lambda fit: fit.good)
    monkeypatch.setattr(conventions, "has_tail", lambda fit: fit.tail)
    monkeypatch.setattr(TriedHypothesis, "compare", lambda tried, other: SimpleNamespace(is_taken=tried.fit.best))
    return monkeypatch


COMMON, WIDER = ["common"], ["wider", "size"]
PAIRING = ["slip", "turned"]


@pytest.mark.parametrize(
    ("fitted", "facts", "found", "tried"),
    [
        (fit_of(), (), {}, COMMON),
        (fit_of(explained=False), (), {}, COMMON + WIDER),
        (fit_of(tail=True), (), {}, COMMON + PAIRING),
        (fit_of(tail=True, explained=False), (), {}, COMMON + WIDER + PAIRING),
        (fit_of(good=False), (), {}, COMMON + PAIRING + ["rare"]),
        (fit_of(), ("a fact",), {}, COMMON + PAIRING + ["rare"]),
        (fit_of(good=False, explained=False), (), {"common": fit_of(best=True)}, COMMON),
        (fit_of(good=False), (), {"common": fit_of()}, COMMON),
        (fit_of(good=False, explained=False), (), {"common": fit_of()}, COMMON + WIDER),
        (fit_of(good=False), (), {"common": fit_of(good=False, best=True)}, COMMON + PAIRING + ["rare"]),
        (fit_of(good=False), (), {"slip": fit_of()}, COMMON + PAIRING),
        (fit_of(good=False), (), {"turned": fit_of(good=False)}, COMMON + PAIRING + ["rare"]),
    ],
)
def test_what_is_tried_goes_by_what_explains_so_far(judged_by_name, fitted, facts, found, tried):
    """Rarer mix-ups one after the other, until something that can be explains the views."""
    assert stages(judged_by_name, fitted, facts, found) == tried


def stages(monkeypatch, fitted, facts=(), found=None, facts_found=(), odd=0.081, survive=True, status="free"):
    """Words of the hypotheses that are fitted in earnest, each from where it is to start."""
    common, wider = hypothesis("common"), hypothesis("wider", is_wider=True)
    tried, starts = [], {"common": ({}, {}), "slip": ({"slip": 1}, {}), "rare": ({}, {}), "turned": None}

    def surviving(reading, lenses, among):
        """All that are no wider model."""
        yield from ()
        return [(each, {}) for each in among if not each.is_wider] if survive else []

    def try_one(reading, each, settings, start, about):
        """What is known of it."""
        tried.append(each.words)
        assert start == starts.get(each.words, "known")
        fit = (found or {}).get(each.words)
        return [] if fit is None else [TriedHypothesis(each, fit, facts_found)]

    known = {
        "convention_hypotheses": [common, wider], "size_hypotheses": [hypothesis("size", is_wider=True)],
        "slip_hypotheses": [(hypothesis("slip"), {"slip": 1})], "half_turn_hypotheses": [hypothesis("turned")],
        "rare_hypotheses": [hypothesis("rare")], "unexplained_motion": odd, "_lenses": {},
    }  # fmt: skip
    for name, value in known.items():
        monkeypatch.setattr(conventions, name, lambda *given, value=value: value)
    monkeypatch.setattr(conventions, "_is_explained", lambda fit: fit.explained)
    monkeypatch.setattr(conventions, "_screen_hypotheses", surviving)
    monkeypatch.setattr(conventions, "_fit_fully", try_one)
    problem = SimpleNamespace(unknowns={"a": SimpleNamespace(status="free"), "b": SimpleNamespace(status=status)})
    tracks = {"eye": SimpleNamespace(moves=True)}
    reading = SimpleNamespace(problem=problem, tracks=tracks, thin=lambda max_count: None)
    ended(conventions._try_hypotheses(reading, TriedHypothesis(hypothesis("declared"), fitted, facts), STATED))
    return tried


def test_what_contradicts_facts_explains_nothing(judged_by_name):
    """However well it fits, the others are tried."""
    found = {"common": fit_of(best=True)}
    tried = stages(judged_by_name, fit_of(good=False), found=found, facts_found=("a fact",))
    assert tried == [*COMMON, *PAIRING, "rare"]


def test_rare_mix_ups_are_tried_where_much_motion_is_unexplained(judged_by_name):
    """From eight hundredths of it on."""
    assert "rare" not in stages(judged_by_name, fit_of(good=False), odd=0.079)


@pytest.mark.parametrize(
    ("status", "good", "tried"), [("prior", False, COMMON), ("free", False, []), ("prior", True, [])]
)
def test_loops_that_only_priors_close_rank_nothing(judged_by_name, status, good, tried):
    """Where a quick look leaves no hypothesis, all are fitted if there are priors and the declared one cannot be."""
    fitted = fit_of(good=good)
    assert stages(judged_by_name, fitted, odd=0.0, survive=False, status=status)[: len(tried)] == tried
    assert ("common" in stages(judged_by_name, fitted, odd=0.0, survive=False, status=status)) == bool(tried)


@pytest.mark.parametrize(
    ("first", "anew", "start", "expected"),
    [
        (fit_of(0.3, good=False), fit_of(0.1), "closed", 0.3),
        (None, fit_of(0.1), "closed", None),
        (fit_of(0.3), fit_of(0.1), "guess", 0.3),
        (fit_of(0.3, good=False), fit_of(0.1), "guess", 0.1),
        (fit_of(0.1, good=False), fit_of(0.3), "guess", 0.1),
        (fit_of(0.3, good=False), None, "guess", 0.3),
        (None, fit_of(0.1), "guess", 0.1),
        (None, None, "guess", None),
    ],
)
def test_a_guess_that_misled_is_no_mix_up(judged_by_name, first, anew, start, expected):
    """Where the declared fit from it cannot be, the better one of it and of one without a guess counts."""
    asked = []

    def fit(cell, problem, settings, known=None):
        """The first with what is known, then without."""
        asked.append((len(problem.groups[0]), settings.start, known))
        return first if known is not None else anew

    judged_by_name.setattr(conventions, "fit_hypothesis", fit)
    judged_by_name.setattr(conventions, "_SOLVED_SAMPLES", 7)
    found = conventions._fit_baseline(
        declared(BOARD.cell, BOARD.recording), Settings(start=start, robot_noise="stated"), "known"
    )
    assert (None if found is None else found.trimmed_rms) == expected
    assert asked[0] == (7, start, "known")
    assert asked[1:] in ([], [(7, "closed", None)])


@pytest.mark.parametrize(
    ("samples", "can", "whole", "facts", "observable", "decided"),
    [
        (5, True, fit_of(), (), True, True),
        (4, True, fit_of(), (), True, False),
        (5, False, fit_of(), (), True, False),
        (5, True, None, (), True, False),
        (5, True, fit_of(), (), False, False),
        (5, True, fit_of(), ("a fact",), False, True),
        (5, True, fit_of(good=False), (), False, True),
    ],
)
def test_when_hypotheses_are_compared(judged_by_name, samples, can, whole, facts, observable, decided):
    """Where samples can be held out, and what fits as declared is not merely left open by the data."""
    told = {}

    def tried(reading, as_is, settings):
        """Nothing."""
        yield from ()
        told.update(declared=as_is, start=settings.start)
        return ["tried"]

    def decide(cell, as_is, found, explained, still):
        """What was told."""
        told.update(found=found, explained=explained, still=still)
        return ("finding",)

    known = {
        "_can_hold_out": can, "_fit_baseline": whole, "is_observable": observable,
        "impossible_reading": (), "impossible_answer": facts,
    }  # fmt: skip
    for name, value in known.items():
        judged_by_name.setattr(conventions, name, lambda *given, value=value: value)
    judged_by_name.setattr(conventions, "count_stops", lambda problem, robot: {"eye": 1, "hand": 2}[robot])
    judged_by_name.setattr(conventions, "_try_hypotheses", tried)
    judged_by_name.setattr(conventions, "decide_hypotheses", decide)
    few = replace(BOARD.recording, samples=BOARD.recording.samples[:samples])
    check = conventions._check_reading(
        declared(BOARD.cell, few), None, Settings(start="guess", robot_noise="stated"), True
    )
    assert ended(check) == (("finding",) if decided else ())
    if decided:
        known = {"start": "closed", "found": ["tried"], "explained": True, "still": frozenset({"eye"})}
        assert {name: told[name] for name in known} == known
        assert (told["declared"].fit, told["declared"].impossible) == (whole, facts)


@pytest.mark.parametrize("links", ["free", "fixed"])
def test_links_take_no_part(monkeypatch, links):
    """Where any robot's links are estimated the problem is that without them; joint offsets are estimated still."""
    made = simulate(Scenario(samples=6, joints=True, joint_offsets="free", link_parameters=links), 0)
    reading = declared(made.cell, made.recording)
    values = {"joint_offsets": np.full(6, 0.1), "link_parameters": np.ones((7, 6))}
    robots = {name: Kinematics(robot.chain, values) for name, robot in made.cell.robots.items()}
    asked = []
    monkeypatch.setattr(conventions, "_can_hold_out", lambda problem: True)
    monkeypatch.setattr(conventions, "_fit_baseline", lambda *given: asked.append(given))
    state = State(made.truth, made.cameras, np.zeros((0, 6)), robots)
    assert ended(conventions._check_reading(reading, state, STATED, False)) == ()
    ((found, _, known),) = asked
    assert {name for model in found.problem.models.values() for name in model.columns} == {"joint_offsets"}
    if links == "free":
        assert [set(robot.parameters) for robot in found.cell.robots.values()] == [{"joint_offsets"}] * 2
        assert [set(of.values) for of in known.robots.values()] == [{"joint_offsets"}] * 2
    else:
        assert (found, known) == (reading, state)


def test_hypotheses_by_order_are_applied_to_all_samples(monkeypatch):
    """The others to as many as tell."""
    monkeypatch.setattr(conventions, "_REWRITTEN_SAMPLES", 6)
    for depends_on_order, count in ((True, 20), (False, 6)):
        each = replace(hypothesis("other"), depends_on_order=depends_on_order)
        assert len(conventions._reread(each, declared(BOARD.cell, BOARD.recording)).order) == count


def test_a_fit_begins_where_loops_were_closed(monkeypatch):
    """The state that a quick look found for the samples that are solved; or the one that is given."""
    begun = []
    monkeypatch.setattr(conventions, "_SOLVED_SAMPLES", 7)
    monkeypatch.setattr(conventions, "pair_state", lambda problem, fits, lenses: (len(problem.groups[0]), fits, lenses))
    monkeypatch.setattr(conventions, "fit_hypothesis", lambda cell, few, settings, start, beyond: begun.append(start))
    as_is = TriedHypothesis(hypothesis("declared"), fit_of(), ())
    for start in (({"fit": 1}, {"lens": 2}), "a state"):
        conventions._fit_fully(declared(BOARD.cell, BOARD.recording), hypothesis("other"), STATED, start, as_is)
    assert begun == [(7, {"fit": 1}, {"lens": 2}), "a state"]


def test_a_quick_look_names_the_fits_of_each_hypothesis(monkeypatch):
    """By camera and target; a hypothesis of which one pair cannot be fitted has none."""

    def pair(camera):
        return SimpleNamespace(group=SimpleNamespace(camera=camera, target="board")), None

    given = {"one": [pair("a"), pair("b")], "two": [pair("a"), pair("b")], "three": []}
    monkeypatch.setattr(conventions, "_pairs", lambda reading, views: given[reading])
    check = conventions._fit_readings(list(given), {})
    assert next(check) == given["one"] + given["two"]
    with pytest.raises(StopIteration) as end:
        check.send(["A", "B", "C", None])
    assert end.value.value == [{("a", "board"): "A", ("b", "board"): "B"}, {}, {}]


@pytest.mark.parametrize("is_led", [True, False])
def test_of_a_light_fewer_views_are_looked_at(is_led):
    """Its search is longer; a cell that makes no problem has no pairs."""
    counts = []

    def of(group, views):
        """Views without poses of their own where they show a light."""
        counts.append(views)
        return SimpleNamespace(candidates=None if is_led else 1, views=views)

    ((some, problem),) = conventions._pairs(declared(BOARD.cell, BOARD.recording), SimpleNamespace(prepare=of))
    assert len(counts) == (2 if is_led else 1)
    assert some.views == counts[-1]
    assert not is_led or counts[1] < counts[0]
    assert [g.camera for g in problem.groups] == ["wrist"]


@pytest.mark.parametrize("error", [BasecalError("no"), np.linalg.LinAlgError()])
def test_what_cannot_be_made_ready_has_no_pairs(error):
    """As where no view has a pose."""

    def fails(*given):
        raise error

    assert conventions._pairs(declared(BOARD.cell, BOARD.recording), SimpleNamespace(prepare=fails)) == []


@pytest.mark.parametrize(
    ("stated", "good", "lens"), [("stated", True, "stated"), (None, True, "solved"), (None, False, "by views")]
)
def test_lenses_are_stated_or_solved_or_seen(judged_by_name, stated, good, lens):
    """By the views of that camera alone, of which those of pixels count."""
    (group,) = build_problem(BOARD.cell, BOARD.recording)[0].groups
    poses = SimpleNamespace(camera="wrist", measurement="poses")
    other = SimpleNamespace(camera="other", measurement=replace(group.measurement))
    problem = SimpleNamespace(lenses={"wrist": SimpleNamespace(camera=stated)}, groups=(group, poses, other))
    judged_by_name.setattr(
        conventions, "lens_from_views", lambda camera, pixels: "by views" if pixels == [group.measurement] else None
    )
    fit = fit_of(good=good)
    fit.solution.state = SimpleNamespace(cameras={"wrist": "solved"})
    assert conventions._lenses(SimpleNamespace(cell=BOARD.cell, problem=problem), fit) == {"wrist": lens}


@pytest.mark.parametrize(
    ("share", "estimated", "tail", "explained"),
    [(1.14, (), False, True), (1.16, (), False, False), (1.14, ("pixel_px",), False, False), (1.14, (), True, False)],
)
def test_stated_sigmas_explain_residuals_of_their_size(judged_by_name, share, estimated, tail, explained):
    """Within 15 %, sigmas that were estimated say nothing, nor do those of most views where some are far off."""
    solution = SimpleNamespace(noise=SimpleNamespace(estimated=estimated), cost=100 * share**2, dof=100)
    assert conventions._is_explained(SimpleNamespace(solution=solution, tail=tail)) == explained
