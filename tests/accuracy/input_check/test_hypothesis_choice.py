"""Tests of `decide_hypotheses`: hypotheses are named by error, effect on the answer, and plausibility."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.shared.declared import declared
from tests.shared.rewriting import resized, with_pixels

from basecal.accuracy.input_check import hypothesis_choice
from basecal.accuracy.input_check import hypothesis_choice as module
from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ROTATE_ARMS, ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_choice import (
    TriedHypothesis,
    _scatter_gain,
    decide_hypotheses,
    has_tail,
    noise_evidence,
)
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit, fit_hypothesis
from basecal.accuracy.input_check.target_sizes import size_hypothesis
from basecal.accuracy.model_comparison.nested_models import Decision
from basecal.effects.faces.effect import FIX
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from quick import quick

ASKED = "eye_base_from_hand_base"


def make_fit(core, whole=None, sigma=1e-3, moved=0.0, unobservable=()):
    """A fit with the given view errors [rad], and the requested transform moved by so many sigmas."""
    off = np.full(10, core)
    off[7:] = np.sqrt((10 * (whole or core) ** 2 - 7 * core**2) / 3)
    solution = SimpleNamespace(
        state=SimpleNamespace(transforms={ASKED: SE3.exp([moved * sigma, 0, 0, 0, 0, 0])}),
        joint_transform_covariance=lambda names: sigma**2 * np.eye(6),
        observability=SimpleNamespace(unobservable=frozenset(unobservable)),
        noise=SimpleNamespace(estimated=("pose_m",)),
        converged=True,
        cost=1.0,
    )
    return HypothesisFit(solution, off, np.arange(10), False)


def findings_about(
    declared, *others, impossible=(), is_wider=False, code="inverted", explained=False, still=frozenset()
):
    """Findings about other hypotheses."""
    cell = SimpleNamespace(
        requested_transforms=(ASKED,), mount_name=lambda name: "mount", robots=("eye", "hand0", "hand1")
    )
    tried = []
    for k, other in enumerate(others):
        about = ("eye", f"hand{k}")
        reading = ConventionHypothesis(
            code, about, f"words {k}", "fix", "rotate {arms}", lambda reading: reading, is_wider
        )
        tried.append(TriedHypothesis(reading, other, ()))
    return decide_hypotheses(cell, TriedHypothesis(AS_DECLARED, declared, impossible), tried, explained, still)


def finding_codes(declared, other, impossible=(), is_wider=False, code="inverted"):
    """Codes of the findings about one other hypothesis."""
    found = findings_about(declared, other, impossible=impossible, is_wider=is_wider, code=code)
    return [f.code for f in found]


@pytest.mark.parametrize(("moved", "found"), [(2.9, []), (3.1, ["ambiguous-convention"])])
def test_equal_fit_is_ambiguous_beyond_three_sigmas(moved, found):
    """A hypothesis that predicts equally well is reported if it moves the requested transform by over three sigmas."""
    assert finding_codes(make_fit(1e-3), make_fit(1e-3, moved=moved)) == found


@pytest.mark.parametrize(("core", "found"), [(0.92e-3, []), (0.9e-3, ["inverted"])])
def test_better_hypothesis_needs_ten_percent(core, found):
    """A hypothesis that moves the answer is an error if it predicts 10 % better.

    One that does not move it is not named.
    """
    assert finding_codes(make_fit(1e-3), make_fit(core, moved=5), code="inverted")[:1] == (
        found or ["ambiguous-convention"]
    )
    assert finding_codes(make_fit(1e-3), make_fit(core)) == []


@pytest.mark.parametrize(("declared", "found"), [(0.029, []), (0.031, ["inverted"])])
def test_implausible_declared_reading_names_unmoved_hypothesis(declared, found):
    """A hypothesis that leaves the requested transform unchanged is named only if the declared one is implausible."""
    assert finding_codes(make_fit(declared), make_fit(1e-3)) == found


@pytest.mark.parametrize(("core", "found"), [(0.6e-3, []), (0.56e-3, ["inverted"])])
def test_wider_model_needs_double_likelihood_ratio(monkeypatch, core, found):
    """A hypothesis with more freedoms is named from a likelihood ratio of 2 on, and never as ambiguous."""
    monkeypatch.setattr(hypothesis_choice, "noise_evidence", lambda fit, declared: None)
    assert finding_codes(make_fit(1e-3), make_fit(core, moved=50), is_wider=True) == found


def test_facts_decide_between_equal_fits():
    """If the declared reading contradicts a fact, an equally good hypothesis is named; a wider one is not."""
    assert finding_codes(make_fit(1e-3), make_fit(1.09e-3), impossible=("reach 9 m",)) == ["inverted"]
    assert finding_codes(make_fit(1e-3), make_fit(1.11e-3), impossible=("reach 9 m",)) == []
    assert finding_codes(make_fit(1e-3), make_fit(1e-3), impossible=("reach 9 m",), is_wider=True) == []


def test_open_loops_are_poor_fit():
    """A declared error above 0.03 rad without a better hypothesis is a poor fit.

    An unobservable hypothesis is not named.
    """
    assert finding_codes(make_fit(0.029), make_fit(0.05)) == []
    assert finding_codes(make_fit(0.031), make_fit(0.05)) == ["poor-fit"]
    assert finding_codes(make_fit(0.031), make_fit(1e-3, unobservable=[ASKED])) == ["poor-fit"]
    assert finding_codes(make_fit(1e-3, unobservable=[ASKED]), make_fit(1e-3, moved=5)) == []


def test_better_hypothesis_reports_both_errors():
    """A better hypothesis is an error that states its words, both cross-validation errors, and the fix."""
    (found,) = findings_about(make_fit(1e-3), make_fit(0.5e-3, moved=5))
    assert (found.severity, found.about) == ("error", ("eye", "hand0"))
    errors = "0.50 mm/m (mrad) instead of 1.0 mm/m (mrad)"
    assert found.message == f"Words 0. Under this hypothesis the cross-validation error is {errors}. Fix. {FIX}"


def test_implausible_answer_is_reported():
    """If a hypothesis fits equally well but the declared one contradicts facts, the message lists those facts."""
    (found,) = findings_about(make_fit(1e-3), make_fit(1e-3), impossible=("a reach of 9 m", "a board in a wall"))
    assert found.message == (
        "Words 0. The declared convention fits equally well, but gives an implausible answer: a reach of 9 m and "
        "a board in a wall. Fix. "
        "Or let `basecal fix CELL` do so."
    )
    assert found.severity == "error"


def test_wider_model_beside_implausible_fit_is_error():
    """A wider model is an error if the declared fit is so bad that no noise could explain it."""
    (found,) = findings_about(make_fit(0.04), make_fit(0.021, moved=5), is_wider=True)
    assert found.severity == "error"


def test_hypotheses_near_best_are_all_named():
    """All hypotheses within a tenth of the best one are named."""
    others = (make_fit(core, moved=5) for core in (4e-4, 4.3e-4, 5e-4))
    found = findings_about(make_fit(1e-3), *others)
    assert [f.about[1] for f in found] == ["hand0", "hand1"]


def test_ambiguous_hypotheses_share_one_finding():
    """Ambiguous hypotheses share one finding with each shift, all names once, and how to distinguish them once."""
    (found,) = findings_about(make_fit(1e-3), make_fit(1e-3, moved=5), make_fit(1.05e-3, moved=7), make_fit(1e-3))
    assert (found.code, found.severity, found.about) == ("ambiguous-convention", "warning", ("eye", "hand0", "hand1"))
    assert f"words 0 (inverted: 1.0 mm/m (mrad), {ASKED} 5.0 mm away) or words 1" in found.message
    assert f"{ASKED} 7.0 mm away" in found.message
    assert found.message.endswith("Check which is true. Rotate eye and hand0 and hand1.")


def test_invalid_hypotheses_are_not_named():
    """A hypothesis is not named if the requested transform is unobservable under it or its fit did not converge."""
    good = make_fit(0.5e-3, moved=5)
    assert findings_about(make_fit(1e-3), good) != ()
    for wrong in (
        make_fit(0.5e-3, moved=5, unobservable=[ASKED]),
        replace(good, solution=SimpleNamespace(**vars(good.solution) | {"converged": False})),
    ):
        assert findings_about(make_fit(1e-3), wrong) == ()


def test_free_mount_moved_by_symmetry_is_ignored():
    """A board's own free mount moves by half a turn if the grid is read from its other end, and is ignored.

    A fixed one counts.
    """
    for status, codes in (("free", []), ("fixed", ["ambiguous-convention"])):
        transforms = {ASKED: SimpleNamespace(status=status)}
        known = {"requested_transforms": (ASKED,), "transforms": transforms, "robots": ()}
        cell = SimpleNamespace(mount_name=lambda name: ASKED, **known)
        reading = ConventionHypothesis("board-symmetry", ("board",), "words", "fix", "", lambda reading: reading)
        tried = TriedHypothesis(reading, make_fit(1e-3, moved=50), ())
        declared = TriedHypothesis(AS_DECLARED, make_fit(1e-3), ())
        found = decide_hypotheses(cell, declared, [tried], False, frozenset())
        assert [f.code for f in found] == codes


def test_missing_requested_mount_counts_as_moved():
    """A requested mount that the rival does not have counts as moved, without a stated distance.

    The rival puts the target on another carrier.
    """
    rival = make_fit(1e-3)
    rival.solution.state.transforms["b_from_c"] = rival.solution.state.transforms.pop(ASKED)
    (found,) = findings_about(make_fit(1e-3), rival, code="wrong-carrier")
    assert (found.code, found.severity) == ("ambiguous-convention", "warning")
    assert "if words 0 (wrong-carrier: 1.0 mm/m (mrad))." in found.what


@pytest.mark.parametrize(
    ("core", "whole", "tail"), [(1e-3, 1.9e-3, False), (1e-3, 2.1e-3, True), (np.inf, np.inf, False)]
)
def test_tail_is_twice_trimmed_error(core, whole, tail):
    """Errors have a tail if the rms of all views is over twice the trimmed rms; infinite errors have none."""
    assert has_tail(SimpleNamespace(trimmed_rms=core, rms=whole)) == tail


def test_comparison_uses_shared_samples():
    """Hypotheses are compared on their shared samples, each by the mean square of its views.

    Errors that are NaN count as far off.
    """
    one = replace(make_fit(1e-3), sample=np.repeat(np.arange(5), 2))
    other = replace(make_fit(2e-3), sample=np.repeat(np.arange(2, 7), 2))
    np.testing.assert_allclose(one.squares(np.arange(2, 5)), 1e-6)
    assert TriedHypothesis(AS_DECLARED, one, ()).compare(other).is_taken
    lost = replace(one, errors=np.where(np.arange(10) < 4, np.nan, one.errors))
    np.testing.assert_allclose(lost.squares(np.arange(5)), [1e6, 1e6, 1e-6, 1e-6, 1e-6])
    assert TriedHypothesis(AS_DECLARED, other, ()).compare(one).decision is Decision.KEEP


@pytest.mark.parametrize("explained", [True, False])
@pytest.mark.parametrize(
    ("evidence", "severity"),
    [
        (SimpleNamespace(is_taken=True, gain=101.0), "error"),
        (SimpleNamespace(is_taken=True, gain=99.0), "warning"),
        (SimpleNamespace(is_taken=False, gain=101.0), None),
        (None, "warning"),
    ],
)
def test_wider_model_is_compared_with_robot_noise(monkeypatch, evidence, explained, severity):
    """A wider model is compared by its likelihood against robot noise, and is an error from a gain of 100 on.

    If the noise evidence is missing, it is only a warning.
    """
    monkeypatch.setattr(hypothesis_choice, "noise_evidence", lambda fit, declared: evidence)
    found = findings_about(make_fit(1e-3), make_fit(0.5e-3, moved=9), is_wider=True, explained=explained)
    assert [f.severity for f in found] == ([] if severity is None else [severity])


FEW = Scenario(samples=8, robot_noise=(1e-4, 2e-4), state_robot_noise=False, state_pixel_noise=False, pixel_px=0.02)
STATED = Settings(robot_noise="stated")


def with_lens(cell, shift_px=0.0, status="fixed"):
    """The cell with the stated principal point shifted."""
    camera = cell.cameras["wrist"]
    parameters = camera.intrinsics.camera.parameters.copy()
    parameters[2] += shift_px
    lens = camera.intrinsics.camera.with_parameters(parameters)
    changed = replace(camera, intrinsics=replace(camera.intrinsics, camera=lens, status=status))
    return replace(cell, cameras={"wrist": changed})


def fit_reading(reading):
    return fit_hypothesis(reading.cell, reading.problem, STATED)


def size_evidence(made, factor):
    """Evidence for a board larger than stated by a factor."""
    given = declared(made.cell, made.recording)
    return noise_evidence(fit_reading(size_hypothesis("board", factor, made.cell).reread(given)), fit_reading(given))


def lens_evidence(made, cell):
    """Evidence for a lens that differs from the stated one."""
    given = declared(cell, made.recording)
    return noise_evidence(fit_reading(given.restate(with_lens(cell, status="free"))), fit_reading(given))


@pytest.mark.journey
@pytest.mark.parametrize("seed", quick(range(3), [0]))
def test_robot_noise_causes_no_size_evidence(seed):
    """Robot noise of 0.1 mm may make a board seem 0.3 % larger, without evidence for it; 3 % are detected."""
    made = simulate(FEW, seed)
    assert size_evidence(made, 1.003).chance > 1e-3
    true = resized(made.cell, {"board": 1.03})
    wrong = size_evidence(replace(made, cell=true), 1 / 1.03)
    assert wrong.chance < 1e-6
    assert wrong.gain > 30


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_systematic_pixels_give_no_size_evidence(seed):
    """Pixels distorted as by no lens give no evidence for or against a size of 2 % if arms err by millimetres."""
    made = simulate(replace(FEW, samples=12, robot_noise=(3e-3, 5e-3), intrinsics="free", pixel_px=0.1), seed)
    bent = with_pixels(made.recording, lambda uv: uv + 6.0 * np.sin(uv[:, ::-1] / (90.0, 70.0)))
    assert abs(size_evidence(replace(made, recording=bent), 1.02).gain) < 2.0


def test_points_in_space_show_target_size():
    """Distances between points measured in space show a size error of 5 %, whatever the robot noise."""
    made = simulate(replace(FEW, target="points3d"), 0)
    wrong = resized(made.cell, {"board": 1.05})
    found = size_evidence(replace(made, cell=wrong), 1 / 1.05)
    assert found.gain > 100
    assert found.chance < 1e-12


@pytest.mark.journey
@pytest.mark.parametrize("seed", quick(range(3), [1]))
def test_robot_noise_causes_no_lens_evidence(seed):
    """The correctly stated lens is plausible; a lens with its centre stated 30 px off is not."""
    made = simulate(FEW, seed)
    assert lens_evidence(made, made.cell).chance > 1e-3
    assert lens_evidence(made, with_lens(made.cell, 30.0)).chance < 1e-6


@pytest.mark.parametrize("stated", [True, False])
def test_scatter_gain_prefers_true_size(stated):
    """The true size gains over one 1 % off exactly as much as that loses, and gains zero over itself."""
    made = simulate(Scenario(samples=6, target="points3d", state_pixel_noise=stated), 0)
    if not stated:
        unstated = [replace(o, sigma_m=None) for s in made.recording.samples for o in s.observations]
        samples = [replace(s, observations=(o,)) for s, o in zip(made.recording.samples, unstated, strict=True)]
        made = replace(made, recording=replace(made.recording, samples=tuple(samples)))
    wrong = resized(made.cell, {"board": 1.01})
    right, off = (fit_reading(declared(cell, made.recording)).solution for cell in (made.cell, wrong))
    assert _scatter_gain(right, right) == 0.0
    assert _scatter_gain(right, off) > 10
    assert _scatter_gain(off, right) == pytest.approx(-_scatter_gain(right, off))


def compare_solutions(monkeypatch, narrower, wider):
    """Evidence of a fit beside the declared one, with these solutions at their noise modes."""
    fits = [
        SimpleNamespace(solution=SimpleNamespace(problem=of, state=None, views=of.views)) for of in (wider, narrower)
    ]
    guesses = {}

    def solve(problem, state, settings, guess=None):
        """Records the initial guess."""
        guesses[problem.name] = guess
        return problem

    monkeypatch.setattr(module, "solve_at_mode", solve)
    monkeypatch.setattr(module, "_view_count", lambda solution: solution.views)
    found = noise_evidence(*fits)
    if found is not None:
        assert guesses == {"narrower": None, "wider": narrower.noise}
    return found


def solution_of(name, minus_2_log_evidence=0.0, columns=(), views=5):
    return SimpleNamespace(
        name=name,
        views=views,
        noise=SimpleNamespace(minus_2_log_evidence=minus_2_log_evidence),
        problem=SimpleNamespace(columns=dict.fromkeys(columns)),
        state=SimpleNamespace(cameras={k: SimpleNamespace(parameters=k) for k in ("a", "b", "c")}),
    )


@pytest.mark.parametrize(("minus_2_log_evidence", "scatter"), [(7.0, 2.0), (3.0, -1.0), (12.0, 1.0)])
def test_gain_adds_evidence_and_scatter(monkeypatch, minus_2_log_evidence, scatter):
    """The gain adds the difference of the negative log evidence and the decrease of scatter.

    One freedom gives a p-value.
    """
    monkeypatch.setattr(module, "_scatter_gain", lambda wider, narrower: scatter)
    found = compare_solutions(
        monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", minus_2_log_evidence, ["a"])
    )
    gain = 10.0 - minus_2_log_evidence + scatter
    assert found.gain == pytest.approx(gain)
    assert found.chance == pytest.approx(chi2.sf(max(gain, 0.0), 1))


def test_gain_of_freed_parameters_is_their_distance(monkeypatch):
    """The gain of freed parameters is their squared distance from the stated values.

    Squares and freedoms of all that only the hypothesis estimates add up.
    """
    squares = {"b": (5.0, 4), "c": (7.0, 9)}
    monkeypatch.setattr(module, "state_step", lambda problem, before, after: "step")
    monkeypatch.setattr(module, "_squared_distance", lambda solution, step, name: squares[name])
    found = compare_solutions(
        monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", 3.0, ["a", "b", "c"])
    )
    assert found.gain == 12.0
    assert found.chance == pytest.approx(chi2.sf(12.0, 13))


def test_different_views_are_not_compared(monkeypatch):
    """Fits of different views have no comparable likelihoods: the evidence is None."""
    assert compare_solutions(monkeypatch, solution_of("narrower"), solution_of("wider", views=4)) is None


def test_scatter_gain_uses_squares_or_logarithm(monkeypatch):
    """Scatter gains by its squares if sigmas are stated, else by the log ratio for each freedom.

    Without scatter there is no gain.
    """
    of = {
        "wider": {
            "stated": (10.0, 30.0),
            "point_m": (4.0, 20.0),
            "nothing": (0.0, 9.0),
            "exact": (3.0, 9.0),
            "m": (0.2, 3.0),
        },
        "narrower": {
            "stated": (14.5, 30.0),
            "point_m": (8.0, 20.0),
            "nothing": (2.0, 9.0),
            "exact": (0.0, 9.0),
            "m": (0.4, 3.0),
        },
    }
    monkeypatch.setattr(module, "_scatter", of.get)
    assert _scatter_gain("wider", "narrower") == pytest.approx(4.5 + 23 * np.log(2.0))


def test_scatter_sums_groups_of_points(monkeypatch):
    """Scatter sums the groups of points in space by their sigma; pixels have none."""
    groups = [
        build_problem(made.cell, made.recording)[0].groups[0]
        for made in (simulate(Scenario(samples=2, target=target), 0) for target in ("points3d", "charuco", "points3d"))
    ]
    estimates = [{"stated": (1.0, 2)}, {"stated": (100.0, 200)}, {"stated": (4.0, 8), "point_m": (16.0, 32)}]

    def view_estimates(problem, group, state):
        """Squares and freedoms of each group."""
        of = estimates[[id(g) for g in groups].index(id(group))]
        return {name: SimpleNamespace(white=white, white_count=count) for name, (white, count) in of.items()}

    monkeypatch.setattr(module, "view_estimates", view_estimates)
    solution = SimpleNamespace(problem=SimpleNamespace(groups=groups), state=None)
    assert module._scatter(solution) == {"stated": (5.0, 10), "point_m": (16.0, 32)}


@pytest.mark.parametrize("size", [6, 3])
def test_squared_distance_uses_step_over_sigma(size):
    """The squared distance of a freed transform is its step over sigma.

    Of a point's mount, the translation alone counts.
    """
    step, sigma = np.array([3e-3, -1e-3, 5e-4, 0.01, 0.0, -0.02]), np.array([1e-3, 2e-3, 5e-4, 0.01, 0.02, 0.01])
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={"a_from_b": slice(1, 1 + size)}),
        covariance=np.diag(np.append(7.0, sigma[:size] ** 2)),
    )
    squared, count = module._squared_distance(solution, np.append(9.0, step[:size]), "a_from_b")
    assert squared == pytest.approx(np.sum((step[:size] / sigma[:size]) ** 2))
    assert count == size


def test_advice_on_arms_is_given_once():
    """One sentence names the arms of all hypotheses that it distinguishes; every arm if one is about no robot."""
    cell = SimpleNamespace(robots=("eye", "hand"))
    made = [ConventionHypothesis("code", about, "", "", ROTATE_ARMS, None) for about in (("eye",), ("hand",), ())]
    assert [*hypothesis_choice._distinctions(cell, made[:2])] == [
        "Rotate eye and hand further about two axes between samples."
    ]
    assert [*hypothesis_choice._distinctions(cell, made)] == [
        "Rotate every arm further about two axes between samples."
    ]
