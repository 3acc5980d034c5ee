"""Tests of `check_conventions`: mix-ups are named, symmetries reported, clean cells pass.

All mutations are in `benchmarks.mutations`.
"""

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


def calibrate_mix_up(made, name):
    """`calibrate` after the mix-up of that name."""
    each = next(m for m in mutations(made.cell, lines_of(made.recording), 0) if m.name.startswith(name))
    return calibrate(each.cell, recording_of(each.lines(lines_of(made.recording)), each.cell))


def error_codes(calibration):
    return {(f.code, f.about) for f in calibration.findings if f.severity == "error"}


@pytest.mark.journey
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
def test_mix_up_is_named(made, name, code, about):
    """Each mix-up yields an error with its code and the names involved, and the verdict is "refused"."""
    calibration = calibrate_mix_up(made, name)
    assert (code, about) in error_codes(calibration)
    assert calibration.verdict == "refused"


def none_survives(*given):
    """Replacement of `_screen_hypotheses` that requests no fit and returns no hypothesis."""
    yield from ()
    return []


@pytest.mark.journey
@pytest.mark.parametrize("look", ["quick", pytest.param("none", marks=pytest.mark.slow)])
def test_exchanged_joints_are_named(look, monkeypatch):
    """Exchanged joints of two arms of one model are named, even if no loop closes without a mount's prior."""
    if look == "none":
        monkeypatch.setattr(conventions, "_screen_hypotheses", none_survives)
    made = simulate(Scenario(samples=12, joints=True, target_mount="prior"), 3)
    found = calibrate(made.cell, exchanged(made.recording, "eye", "hand"))
    assert error_codes(found) == {("robots-swapped", ("eye", "hand"))}
    assert "The joints of eye and hand are exchanged" in found.findings[0].message


@pytest.mark.journey
@pytest.mark.parametrize("made", [BOARD, POSES, LIGHT])
def test_clean_cells_get_verdict_good(made):
    """Clean cells of two freely rotating arms get the verdict "good": no other hypothesis comes near."""
    assert calibrate(made.cell, made.recording).verdict == "good"


@pytest.mark.journey
@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_estimated_links_cause_no_false_mix_up(factor):
    """Arms with joints and estimated links raise no suspicion of a mix-up, and a wrong target size is still found."""
    scenario = Scenario(samples=16, joints=True, link_error=(5e-4, 1e-3), link_parameters="prior")
    made = simulate(scenario, 7)
    cell = resized(made.cell, {"board": factor})
    problem, _ = build_problem(cell, made.recording)
    plain = solve_problem(problem, cell, STATED)
    found = conventions.check_conventions(cell, made.recording, problem, plain, STATED, False)
    assert [f.code for f in found] == (["board-size"] if factor > 1 else [])


@pytest.mark.slow
def test_exchanged_robots_and_inverted_target_are_both_named():
    """Exchanged robots and an inverted target are both named if both fit equally well.

    The z axis of the target points to the camera, so the inverted target stays in front of it; rotations are measured
    so well that noise does not distinguish the two ends of a pose.
    """
    made = simulate(Scenario(samples=20, target="pose", pose_noise=(1e-3, 1e-5)), 7)
    half = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
    towards_the_camera = with_targets(made.recording, lambda poses: poses @ half)
    found = error_codes(calibrate(made.cell, with_targets(towards_the_camera, inverted)))
    assert {code for code, _ in found} - {"unobservable-direction"} == {"target-pose-inverted", "robots-swapped"}


@pytest.mark.journey
def test_poses_of_still_arm_are_ambiguous():
    """An arm with a single pose gives an "ambiguous-convention" finding of severity info.

    No data can show whether that pose is inverted; the finding says how to check, and the verdict stays "good".
    """
    made = simulate(Scenario(samples=15, arms="eye_still", camera_mount="fixed"), 0)
    calibration = calibrate(made.cell, made.recording)
    (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
    assert (calibration.verdict, finding.severity) == ("good", "info")
    assert "robot-pose-inverted" in finding.message
    assert "Rotate eye" in finding.message


@pytest.mark.slow
def test_inverted_head_poses_of_nao_are_ambiguous():
    """NAO's inverted head poses fit as well and put the base 0.58 m away.

    The ambiguity is reported for the recording and for its inverted twin.
    """
    try:
        cell, recording = nao_cell()
    except DatasetError as error:
        pytest.skip(str(error))
    for each in (recording, with_robots(recording, {"eye": inverted})):
        calibration = calibrate(cell, each)
        (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
        assert calibration.verdict == "doubtful"
        assert "the poses of eye are inverted" in finding.message


@pytest.mark.journey
def test_wrong_fixed_lens_of_rct_is_named():
    """The lens guess shipped with the RCT recording (1400 px, no distortion), stated as fixed, yields `intrinsics`."""
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


@pytest.mark.journey
def test_half_turn_without_effect_on_answer_is_not_reported():
    """A chessboard's half turn that only changes the board's own mount is not reported.

    Only the camera moves, and the board lies on the world.
    """
    made = simulate(Scenario(samples=15, layout="eye_in_hand", target="chessboard"), 0)
    assert calibrate(made.cell, made.recording).verdict == "good"


@pytest.mark.journey
def test_size_error_of_one_thousandth_is_not_named():
    """A target size off by a thousandth is not named: it hardly improves the fit, though it moves the answer."""
    made = simulate(Scenario(samples=20, robot_noise=(3e-4, 5e-4)), 1)
    found = calibrate(resized(made.cell, {"board": 1.001}), made.recording)
    assert "board-size" not in {f.code for f in found.findings}


@pytest.mark.slow
def test_disturbed_poses_are_not_good():
    """Observed poses disturbed by half a metre and radian fit no hypothesis.

    None is named, and the verdict is not good.
    """
    rng = np.random.default_rng(0)
    made = simulate(Scenario(samples=20, target="pose", state_observation_noise=False), 0)
    wild = with_targets(made.recording, lambda poses: poses @ SE3.exp(0.5 * rng.normal(size=(len(poses), 6))))
    found = calibrate(made.cell, wild)
    assert found.verdict != "good"
    assert {f.code for f in found.findings} <= {"poor-fit", "unobservable-direction", "not-converged"}


@pytest.mark.parametrize(("samples", "can"), [(5, False), (6, True)])
def test_hold_out_needs_six_pose_samples(samples, can):
    """Hold-out needs six samples of measured poses for 18 unknowns.

    Each gives six equations; two of three folds must leave a quarter more equations than unknowns.
    """
    made = simulate(Scenario(samples=samples, target="pose"), 0)
    assert conventions._can_hold_out(build_problem(made.cell, made.recording)[0]) == can


def hypothesis(words, code="length-unit", about=("eye",), is_wider=False):
    """A hypothesis that changes nothing."""
    return ConventionHypothesis(code, about, words, "", "", lambda reading: reading, is_wider)


def find_survivors(monkeypatch, offs, among=None, is_led=False, made=BOARD):
    """Words of the hypotheses that survive a quick look, by their view errors, the declared one first."""
    fits = [{("wrist", "board"): LoopFit((), np.full(4, off), is_led)} if off is not None else {} for off in offs]
    inputs_seen = []

    def screened(inputs, lenses):
        """Replacement of `_fit_readings` with known fits."""
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
        ((0.02, 0.071, 0.069, 0.01), False, ["3"]),  # limit 0.04: three times the best error plus 0.01 rad
        ((0.1, 0.3, 0.29, 0.32, 0.2), False, ["4", "2", "1"]),
        ((0.26, 0.24), False, ["1"]),
        ((0.26, 0.26), False, []),
        ((0.02, None), False, []),
        ((0.01, 0.031, 0.033), True, ["1"]),  # the floor of an LED is 0.002 rad
        ((0.06, 0.049), True, ["1"]),
        ((0.06, 0.051), True, []),
    ],
)
def test_hypotheses_near_best_loop_fit_are_fitted(monkeypatch, offs, is_led, words):
    """Hypotheses within three times the best loop error, or a floor, are fitted, the best first.

    If even the best leaves loops open, none is.
    """
    assert find_survivors(monkeypatch, offs, is_led=is_led) == (words, len(offs))


def test_at_most_eight_hypotheses_are_fitted(monkeypatch):
    """At most the eight best hypotheses are fitted."""
    words, _ = find_survivors(monkeypatch, [0.02, *np.linspace(0.03, 0.02, 12)])
    assert words == [str(k) for k in range(12, 4, -1)]


def test_quick_look_skips_undecidable_hypotheses(monkeypatch):
    """The quick look omits wider models, and samples paired one late with robots that never move."""
    late = [hypothesis("both", "pairing-shifted", ("eye", "hand")), hypothesis("hand", "pairing-shifted", ("hand",))]
    among = [hypothesis("wider", is_wider=True), *late, hypothesis("exchanged", about=("eye", "hand"))]
    still = simulate(Scenario(samples=6, arms="eye_still"), 0)
    assert find_survivors(monkeypatch, [0.02] * 3, among, made=still) == (["hand", "exchanged"], 3)


@pytest.mark.parametrize(("off", "facts", "explains"), [
    (np.full(10, 0.01), (), True),
    (np.repeat([0.01, 0.1], [7, 3]), (), False),  # a session of three samples stays unexplained
    (np.full(10, 0.01), ("a fact",), False),
])  # fmt: skip
def test_partial_explanation_does_not_end_search(off, facts, explains):
    """The search ends only at a hypothesis that explains all sessions and contradicts no fact."""
    solution = SimpleNamespace(converged=True, cost=1.0, noise=SimpleNamespace(estimated=("pose_m",)))
    tried = TriedHypothesis(hypothesis("inverted"), HypothesisFit(solution, off, np.arange(10), False), facts)
    assert conventions._explains_all(tried) is explains


def test_fit_limit_is_twice_declared_error(monkeypatch):
    """The fit of a hypothesis stops at twice the declared error.

    The limit is passed to the fit, and a hypothesis that contradicts a fact is not fitted.
    """
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
def test_hold_out_needs_quarter_more_equations(equations, enough):
    """Two thirds of the samples need a quarter more equations than unknowns.

    For 18 unknowns, 22.5 must be left in two folds: 34 equations leave 22.7, 33 are too few.
    """
    assert conventions._can_hold_out(SimpleNamespace(equation_count=equations, width=18)) == enough


def test_led_loop_limits_apply_to_pose_hypotheses(monkeypatch):
    """If the declared fit is that of an LED, a pose hypothesis beside it is held to the LED's limits."""
    fits = [{("wrist", "board"): LoopFit((), np.full(4, off), light)} for off, light in ((0.06, True), (0.055, False))]

    def screened(inputs, lenses):
        """Replacement of `_fit_readings` with known fits."""
        yield from ()
        return fits

    monkeypatch.setattr(conventions, "_fit_readings", screened)
    assert (
        return_value(conventions._screen_hypotheses(declared(BOARD.cell, BOARD.recording), {}, [hypothesis("other")]))
        == []
    )


def return_value(check):
    """Return value of a check that requests no fit."""
    with pytest.raises(StopIteration) as end:
        next(check)
    return end.value.value


def test_parallel_checks_get_their_own_fits(monkeypatch):
    """Checks in step receive the fits that they requested: one asks twice, one never, one once for two pairs."""
    asked = []
    monkeypatch.setattr(conventions, "fit_loops", lambda pairs: asked.append(pairs) or [f"fit of {p}" for p in pairs])

    def check(*wanted):
        """Requests these fits, one after the other."""
        received = []
        for each in wanted:
            received.append((yield each))
        return received

    found = conventions._run_checks([check(["a"], ["b"]), check(), check(["c", "d"])])
    assert found == [[["fit of a"], ["fit of b"]], [], [["fit of c", "fit of d"]]]
    assert asked[:2] == [["a", "c", "d"], ["b"]]


def test_many_robots_are_checked_in_pairs(monkeypatch):
    """Cells of many robots are checked in pairs, eight at a time and in order, and their findings are merged."""
    pairs = [SimpleNamespace(reading=f"reading {k}", state=k) for k in range(17)]
    given_readings, parts, steps = [], [], []
    in_step = conventions._run_checks

    def checked(reading, state, settings, explained):
        """Finds the number of the pair."""
        given_readings.append((reading, explained))
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
    assert given_readings == [(f"reading {k}", False) for k in range(17)]
    assert (steps, parts) == ([8, 8, 1], [(0, 17), (8, 17), (16, 17)])


@pytest.mark.parametrize(("joint", "expected"), [((), [("hidden",)]), (("found",), ("found",))])
def test_unexplained_pairs_are_checked_alone(monkeypatch, joint, expected):
    """If all views together decide no hypothesis, each pair of a camera and a target that is unexplained is checked."""

    def checked(reading, state, settings, explained):
        """Findings about all views, or about those of a pair."""
        yield from ()
        return joint if reading == "whole" else (reading,)

    def pairs_of(baseline, state, groups):
        """A pair for each group."""
        return [SimpleNamespace(reading=group, state=state) for group in groups]

    monkeypatch.setattr(conventions, "has_many_robots", lambda problem: False)
    monkeypatch.setattr(conventions, "is_hopeless", lambda groups, state: groups == ("hidden",))
    monkeypatch.setattr(conventions, "solve_single_pairs", pairs_of)
    monkeypatch.setattr(conventions, "merge_findings", lambda pairs, found: found)
    monkeypatch.setattr(conventions, "declared_reading", lambda *given: "whole")
    monkeypatch.setattr(conventions, "_check_reading", checked)
    problem = SimpleNamespace(groups=["sound", "hidden"], with_groups=lambda groups: groups)
    given = (BOARD.cell, BOARD.recording, problem, SimpleNamespace(state=None), Settings())
    assert conventions.check_conventions(*given, False) == expected


def fit_of(core=0.01, good=True, tail=False, explained=True, best=False):
    """A fit with the given properties."""
    solution = SimpleNamespace(state="known", problem=None)
    return SimpleNamespace(trimmed_rms=core, good=good, tail=tail, explained=explained, best=best, solution=solution)


@pytest.fixture
def judged_by_name(monkeypatch):
    """Makes plausibility, tail and comparison of `fit_of` fits follow their fields."""
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
def test_rarer_hypotheses_follow_until_views_are_explained(judged_by_name, fitted, facts, found, tried):
    """Rarer mix-ups are tried one after the other until a plausible one explains the views."""
    assert stages(judged_by_name, fitted, facts, found) == tried


def stages(monkeypatch, fitted, facts=(), found=None, facts_found=(), odd=0.081, survive=True, status="free"):
    """Words of the fully fitted hypotheses; asserts the start of each."""
    common, wider = hypothesis("common"), hypothesis("wider", is_wider=True)
    tried, starts = [], {"common": ({}, {}), "slip": ({"slip": 1}, {}), "rare": ({}, {}), "turned": None}

    def surviving(reading, lenses, among):
        """All hypotheses except wider models."""
        yield from ()
        return [(each, {}) for each in among if not each.is_wider] if survive else []

    def try_one(reading, each, settings, start, about):
        """The known fit of the hypothesis."""
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
    return_value(conventions._try_hypotheses(reading, TriedHypothesis(hypothesis("declared"), fitted, facts), STATED))
    return tried


def test_hypothesis_against_facts_does_not_end_search(judged_by_name):
    """A hypothesis that contradicts facts does not end the search, however well it fits: the others are tried."""
    found = {"common": fit_of(best=True)}
    tried = stages(judged_by_name, fit_of(good=False), found=found, facts_found=("a fact",))
    assert tried == [*COMMON, *PAIRING, "rare"]


def test_rare_mix_ups_need_unexplained_motion(judged_by_name):
    """Rare mix-ups are tried only if at least 8 % of the motion is unexplained."""
    assert "rare" not in stages(judged_by_name, fit_of(good=False), odd=0.079)


@pytest.mark.parametrize(
    ("status", "good", "tried"), [("prior", False, COMMON), ("free", False, []), ("prior", True, [])]
)
def test_priors_alone_allow_fits_of_all_hypotheses(judged_by_name, status, good, tried):
    """If the quick look leaves no hypothesis, all are fitted if priors exist and the declared one is implausible."""
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
def test_misleading_guess_is_no_mix_up(judged_by_name, first, anew, start, expected):
    """If the declared fit from a guess is implausible, the better of it and of a fit without a guess counts."""
    asked = []

    def fit(cell, problem, settings, known=None):
        """The first fit if a state is given, then the one without."""
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
def test_comparison_needs_hold_out_and_observability(judged_by_name, samples, can, whole, facts, observable, decided):
    """Hypotheses are compared if samples can be held out, and if a plausible declared fit is observable."""
    arguments = {}

    def tried(reading, as_is, settings):
        """Records its arguments."""
        yield from ()
        arguments.update(declared=as_is, start=settings.start)
        return ["tried"]

    def decide(cell, as_is, found, explained, still):
        """Records its arguments."""
        arguments.update(found=found, explained=explained, still=still)
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
    assert return_value(check) == (("finding",) if decided else ())
    if decided:
        known = {"start": "closed", "found": ["tried"], "explained": True, "still": frozenset({"eye"})}
        assert {name: arguments[name] for name in known} == known
        assert (arguments["declared"].fit, arguments["declared"].impossible) == (whole, facts)


@pytest.mark.parametrize("links", ["free", "fixed"])
def test_link_parameters_are_excluded_from_check(monkeypatch, links):
    """If links of any robot are estimated, the check uses the problem without them; joint offsets stay estimated."""
    made = simulate(Scenario(samples=6, joints=True, joint_offsets="free", link_parameters=links), 0)
    reading = declared(made.cell, made.recording)
    values = {"joint_offsets": np.full(6, 0.1), "link_parameters": np.ones((7, 6))}
    robots = {name: Kinematics(robot.chain, values) for name, robot in made.cell.robots.items()}
    asked = []
    monkeypatch.setattr(conventions, "_can_hold_out", lambda problem: True)
    monkeypatch.setattr(conventions, "_fit_baseline", lambda *given: asked.append(given))
    state = State(made.truth, made.cameras, np.zeros((0, 6)), robots)
    assert return_value(conventions._check_reading(reading, state, STATED, False)) == ()
    ((found, _, known),) = asked
    assert {name for model in found.problem.models.values() for name in model.columns} == {"joint_offsets"}
    if links == "free":
        assert [set(robot.parameters) for robot in found.cell.robots.values()] == [{"joint_offsets"}] * 2
        assert [set(of.values) for of in known.robots.values()] == [{"joint_offsets"}] * 2
    else:
        assert (found, known) == (reading, state)


def test_order_hypotheses_use_all_samples(monkeypatch):
    """Hypotheses that depend on the sample order use all samples, others only a sufficient number."""
    monkeypatch.setattr(conventions, "_REWRITTEN_SAMPLES", 6)
    for depends_on_order, count in ((True, 20), (False, 6)):
        each = replace(hypothesis("other"), depends_on_order=depends_on_order)
        assert len(conventions._reread(each, declared(BOARD.cell, BOARD.recording)).order) == count


def test_fit_starts_from_loop_closure_state(monkeypatch):
    """A fit starts from the state that the quick look found for the solved samples, or from a given state."""
    begun = []
    monkeypatch.setattr(conventions, "_SOLVED_SAMPLES", 7)
    monkeypatch.setattr(conventions, "pair_state", lambda problem, fits, lenses: (len(problem.groups[0]), fits, lenses))
    monkeypatch.setattr(conventions, "fit_hypothesis", lambda cell, few, settings, start, beyond: begun.append(start))
    as_is = TriedHypothesis(hypothesis("declared"), fit_of(), ())
    for start in (({"fit": 1}, {"lens": 2}), "a state"):
        conventions._fit_fully(declared(BOARD.cell, BOARD.recording), hypothesis("other"), STATED, start, as_is)
    assert begun == [(7, {"fit": 1}, {"lens": 2}), "a state"]


def test_quick_look_fits_are_keyed_by_camera_and_target(monkeypatch):
    """Quick-look fits are keyed by camera and target; a hypothesis with a pair that cannot be fitted has none."""

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
def test_fewer_views_of_leds_are_searched(is_led):
    """Fewer views of an LED are used because its search is longer; a cell without a problem has no pairs."""
    counts = []

    def of(group, views):
        """Views without candidate poses if they show an LED."""
        counts.append(views)
        return SimpleNamespace(candidates=None if is_led else 1, views=views)

    ((some, problem),) = conventions._pairs(declared(BOARD.cell, BOARD.recording), SimpleNamespace(prepare=of))
    assert len(counts) == (2 if is_led else 1)
    assert some.views == counts[-1]
    assert not is_led or counts[1] < counts[0]
    assert [g.camera for g in problem.groups] == ["wrist"]


@pytest.mark.parametrize("error", [BasecalError("no"), np.linalg.LinAlgError()])
def test_failed_preparation_gives_no_pairs(error):
    """Views whose preparation fails, e.g. because no view has a pose, give no pairs."""

    def fails(*given):
        raise error

    assert conventions._pairs(declared(BOARD.cell, BOARD.recording), SimpleNamespace(prepare=fails)) == []


@pytest.mark.parametrize(
    ("stated", "good", "lens"), [("stated", True, "stated"), (None, True, "solved"), (None, False, "by views")]
)
def test_lens_source_is_stated_solved_or_views(judged_by_name, stated, good, lens):
    """The lens is the stated one, else the solved one of a plausible fit, else that from the camera's own views.

    Only views with pixels count.
    """
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
    """Residuals within 15 % of stated sigmas are explained.

    Estimated sigmas explain nothing, nor do residuals with a tail of far views.
    """
    solution = SimpleNamespace(noise=SimpleNamespace(estimated=estimated), cost=100 * share**2, dof=100)
    assert conventions._is_explained(SimpleNamespace(solution=solution, tail=tail)) == explained
