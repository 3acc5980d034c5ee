"""Which fitted hypotheses are named, by how well they predict, what they move and what cannot be."""

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
from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ConventionHypothesis
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


def predicted(core, whole=None, sigma=1e-3, moved=0.0, unobservable=()):
    """A fit whose views are off by so much [rad], with what is asked moved by so many of its sigmas."""
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
    """Findings about other readings."""
    cell = SimpleNamespace(requested_transforms=(ASKED,), mount_name=lambda name: "mount")
    tried = []
    for k, other in enumerate(others):
        about = ("eye", f"hand{k}")
        reading = ConventionHypothesis(code, about, f"words {k}", "fix", "tell", lambda reading: reading, is_wider)
        tried.append(TriedHypothesis(reading, other, ()))
    return decide_hypotheses(cell, TriedHypothesis(AS_DECLARED, declared, impossible), tried, explained, still)


def decided(declared, other, impossible=(), is_wider=False, code="inverted"):
    """Codes of the findings about one other reading."""
    found = findings_about(declared, other, impossible=impossible, is_wider=is_wider, code=code)
    return [f.code for f in found]


@pytest.mark.parametrize(("moved", "found"), [(2.9, []), (3.1, ["ambiguous-convention"])])
def test_a_reading_that_fits_as_well_must_move_what_is_asked(moved, found):
    """Readings that predict as well are told from three sigmas on."""
    assert decided(predicted(1e-3), predicted(1e-3, moved=moved)) == found


@pytest.mark.parametrize(("core", "found"), [(0.92e-3, []), (0.9e-3, ["inverted"])])
def test_a_better_reading_is_a_tenth_better(core, found):
    """What moves the answer is believed if it predicts a tenth better; what does not is not named."""
    assert decided(predicted(1e-3), predicted(core, moved=5), code="inverted")[:1] == (
        found or ["ambiguous-convention"]
    )
    assert decided(predicted(1e-3), predicted(core)) == []


@pytest.mark.parametrize(("declared", "found"), [(0.029, []), (0.031, ["inverted"])])
def test_what_moves_nothing_is_named_beside_what_is_implausible(declared, found):
    """A reading that leaves what is requested alone is of no interest if the declared one can be."""
    assert decided(predicted(declared), predicted(1e-3)) == found


@pytest.mark.parametrize(("core", "found"), [(0.6e-3, []), (0.56e-3, ["inverted"])])
def test_a_wider_model_must_be_much_better(monkeypatch, core, found):
    """A reading with more freedoms is named from a ratio of likelihoods of 2 on, and never as ambiguous."""
    monkeypatch.setattr(hypothesis_choice, "noise_evidence", lambda fit, declared: None)
    assert decided(predicted(1e-3), predicted(core, moved=50), is_wider=True) == found


def test_facts_decide_between_equals():
    """Where the declared reading contradicts a fact, one that predicts as well is named, a wider one is not."""
    assert decided(predicted(1e-3), predicted(1.09e-3), impossible=("reach 9 m",)) == ["inverted"]
    assert decided(predicted(1e-3), predicted(1.11e-3), impossible=("reach 9 m",)) == []
    assert decided(predicted(1e-3), predicted(1e-3), impossible=("reach 9 m",), is_wider=True) == []


def test_loops_that_nothing_closes_are_told():
    """A declared reading beyond 0.03 rad with no better one is a poor fit; so is no reading that is not seen."""
    assert decided(predicted(0.029), predicted(0.05)) == []
    assert decided(predicted(0.031), predicted(0.05)) == ["poor-fit"]
    assert decided(predicted(0.031), predicted(1e-3, unobservable=[ASKED])) == ["poor-fit"]
    assert decided(predicted(1e-3, unobservable=[ASKED]), predicted(1e-3, moved=5)) == []


def test_what_explains_the_data_better_is_an_error_with_both_errors():
    """Its words, how well it predicts and how well what is declared does, and what to do."""
    (found,) = findings_about(predicted(1e-3), predicted(0.5e-3, moved=5))
    assert (found.severity, found.about) == ("error", ("eye", "hand0"))
    errors = "0.50 mm/m (mrad) instead of 1.0 mm/m (mrad)"
    assert found.message == f"Words 0. Under this hypothesis the cross-validation error is {errors}. Fix. {FIX}"


def test_what_cannot_be_is_said():
    """Where a reading only fits as well, but the declared one contradicts facts."""
    (found,) = findings_about(predicted(1e-3), predicted(1e-3), impossible=("a reach of 9 m", "a board in a wall"))
    assert found.message == (
        "Words 0. The declared convention fits equally well, but gives an implausible answer: a reach of 9 m and "
        "a board in a wall. Fix. "
        "Or let `basecal fix CELL` do so."
    )
    assert found.severity == "error"


def test_a_wider_model_beside_what_is_implausible_is_an_error():
    """No noise could explain the declared reading."""
    (found,) = findings_about(predicted(0.04), predicted(0.021, moved=5), is_wider=True)
    assert found.severity == "error"


def test_readings_about_as_good_as_the_best_are_all_named():
    """Within a tenth of it."""
    others = (predicted(core, moved=5) for core in (4e-4, 4.3e-4, 5e-4))
    found = findings_about(predicted(1e-3), *others)
    assert [f.about[1] for f in found] == ["hand0", "hand1"]


def test_ambiguous_readings_are_one_finding():
    """With how far each moves what is asked, all that they are about once, and how to tell them apart once."""
    (found,) = findings_about(predicted(1e-3), predicted(1e-3, moved=5), predicted(1.05e-3, moved=7), predicted(1e-3))
    assert (found.code, found.severity, found.about) == ("ambiguous-convention", "warning", ("eye", "hand0", "hand1"))
    assert f"words 0 (inverted: 1.0 mm/m (mrad), {ASKED} 5.0 mm away) or words 1" in found.message
    assert f"{ASKED} 7.0 mm away" in found.message
    assert found.message.endswith("Check which is true. Tell.")


def test_a_reading_that_is_no_answer_is_not_named():
    """Contradicting facts, not seeing what is asked, or implausible."""
    good = predicted(0.5e-3, moved=5)
    assert findings_about(predicted(1e-3), good) != ()
    for wrong in (
        predicted(0.5e-3, moved=5, unobservable=[ASKED]),
        replace(good, solution=SimpleNamespace(**vars(good.solution) | {"converged": False})),
    ):
        assert findings_about(predicted(1e-3), wrong) == ()


def test_a_mount_that_a_symmetry_moves_does_not_count():
    """A board's own mount, free, moves by half a turn where the grid is read from its other end; fixed it counts."""
    for status, codes in (("free", []), ("fixed", ["ambiguous-convention"])):
        transforms = {ASKED: SimpleNamespace(status=status)}
        cell = SimpleNamespace(requested_transforms=(ASKED,), mount_name=lambda name: ASKED, transforms=transforms)
        reading = ConventionHypothesis("board-symmetry", ("board",), "words", "fix", "", lambda reading: reading)
        tried = TriedHypothesis(reading, predicted(1e-3, moved=50), ())
        declared = TriedHypothesis(AS_DECLARED, predicted(1e-3), ())
        found = decide_hypotheses(cell, declared, [tried], False, frozenset())
        assert [f.code for f in found] == codes


def test_a_target_on_another_carrier_has_another_mount():
    """A requested mount that the rival does not have has moved; how far cannot be said."""
    rival = predicted(1e-3)
    rival.solution.state.transforms["b_from_c"] = rival.solution.state.transforms.pop(ASKED)
    (found,) = findings_about(predicted(1e-3), rival, code="wrong-carrier")
    assert (found.code, found.severity) == ("ambiguous-convention", "warning")
    assert "if words 0 (wrong-carrier: 1.0 mm/m (mrad))." in found.what


@pytest.mark.parametrize(
    ("core", "whole", "tail"), [(1e-3, 1.9e-3, False), (1e-3, 2.1e-3, True), (np.inf, np.inf, False)]
)
def test_a_tail_is_twice_as_far_off_as_most(core, whole, tail):
    """Where anything is predicted at all."""
    assert has_tail(SimpleNamespace(trimmed_rms=core, rms=whole)) == tail


def test_readings_are_compared_by_the_samples_that_both_have():
    """Each sample by the mean square of its views; what is no number counts as far off."""
    one = replace(predicted(1e-3), sample=np.repeat(np.arange(5), 2))
    other = replace(predicted(2e-3), sample=np.repeat(np.arange(2, 7), 2))
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
def test_a_wider_model_is_held_against_noise_of_arms(monkeypatch, evidence, explained, severity):
    """By its likelihood with noise beside it, certain from a hundred on; by other views it is only a doubt."""
    monkeypatch.setattr(hypothesis_choice, "noise_evidence", lambda fit, declared: evidence)
    found = findings_about(predicted(1e-3), predicted(0.5e-3, moved=9), is_wider=True, explained=explained)
    assert [f.severity for f in found] == ([] if severity is None else [severity])


FEW = Scenario(samples=8, robot_noise=(1e-4, 2e-4), state_robot_noise=False, state_pixel_noise=False, pixel_px=0.02)
STATED = Settings(robot_noise="stated")


def with_lens(cell, shift_px=0.0, status="fixed"):
    """The cell with the principal point stated off by so much."""
    camera = cell.cameras["wrist"]
    parameters = camera.intrinsics.camera.parameters.copy()
    parameters[2] += shift_px
    lens = camera.intrinsics.camera.with_parameters(parameters)
    changed = replace(camera, intrinsics=replace(camera.intrinsics, camera=lens, status=status))
    return replace(cell, cameras={"wrist": changed})


def fitted(reading):
    return fit_hypothesis(reading.cell, reading.problem, STATED)


def of_size(made, factor):
    """Evidence for a board so many times as large as stated."""
    given = declared(made.cell, made.recording)
    return noise_evidence(fitted(size_hypothesis("board", factor, made.cell).reread(given)), fitted(given))


def of_lens(made, cell):
    """Evidence for a lens that is not as the cell states."""
    given = declared(cell, made.recording)
    return noise_evidence(fitted(given.restate(with_lens(cell, status="free"))), fitted(given))


@pytest.mark.parametrize("seed", quick(range(3), [0]))
def test_noise_of_arms_is_no_size(seed):
    """By 0.3 % a board may seem larger where arms are off by 0.1 mm: likelihoods do not ask for it; for 3 % they do."""
    made = simulate(FEW, seed)
    assert of_size(made, 1.003).chance > 1e-3
    true = resized(made.cell, {"board": 1.03})
    wrong = of_size(replace(made, cell=true), 1 / 1.03)
    assert wrong.chance < 1e-6
    assert wrong.gain > 30


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_pixels_of_any_size_scatter_alike(seed):
    """Pixels bent as no lens bends them say nothing for or against a size of 2 % where arms are off by millimetres."""
    made = simulate(replace(FEW, samples=12, robot_noise=(3e-3, 5e-3), intrinsics="free", pixel_px=0.1), seed)
    bent = with_pixels(made.recording, lambda uv: uv + 6.0 * np.sin(uv[:, ::-1] / (90.0, 70.0)))
    assert abs(of_size(replace(made, recording=bent), 1.02).gain) < 2.0


def test_points_in_space_show_their_size():
    """Distances between points that are measured in space tell a size of 5 % whatever arms do."""
    made = simulate(replace(FEW, target="points3d"), 0)
    wrong = resized(made.cell, {"board": 1.05})
    found = of_size(replace(made, cell=wrong), 1 / 1.05)
    assert found.gain > 100
    assert found.chance < 1e-12


@pytest.mark.parametrize("seed", quick(range(3), [1]))
def test_noise_of_arms_is_no_lens(seed):
    """A lens as stated has chance; one whose centre is stated 30 px off has none."""
    made = simulate(FEW, seed)
    assert of_lens(made, made.cell).chance > 1e-3
    assert of_lens(made, with_lens(made.cell, 30.0)).chance < 1e-6


@pytest.mark.parametrize("stated", [True, False])
def test_points_in_space_speak_for_the_size_about_which_they_scatter_less(stated):
    """The true size gains over one a hundredth off what that loses over it, and nothing over itself."""
    made = simulate(Scenario(samples=6, target="points3d", state_pixel_noise=stated), 0)
    if not stated:
        unstated = [replace(o, sigma_m=None) for s in made.recording.samples for o in s.observations]
        samples = [replace(s, observations=(o,)) for s, o in zip(made.recording.samples, unstated, strict=True)]
        made = replace(made, recording=replace(made.recording, samples=tuple(samples)))
    wrong = resized(made.cell, {"board": 1.01})
    right, off = (fitted(declared(cell, made.recording)).solution for cell in (made.cell, wrong))
    assert _scatter_gain(right, right) == 0.0
    assert _scatter_gain(right, off) > 10
    assert _scatter_gain(off, right) == pytest.approx(-_scatter_gain(right, off))


def known(monkeypatch, narrower, wider):
    """Evidence of a fit beside the declared one, whose solutions with noise are these."""
    fits = [
        SimpleNamespace(solution=SimpleNamespace(problem=of, state=None, views=of.views)) for of in (wider, narrower)
    ]
    told = {}

    def solve(problem, state, settings, guess=None):
        """As it is told."""
        told[problem.name] = guess
        return problem

    monkeypatch.setattr(module, "solve_at_mode", solve)
    monkeypatch.setattr(module, "_view_count", lambda solution: solution.views)
    found = noise_evidence(*fits)
    if found is not None:
        assert told == {"narrower": None, "wider": narrower.noise}
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
def test_a_gain_is_of_both_likelihoods(monkeypatch, minus_2_log_evidence, scatter):
    """What the declared noise is surprised by more, and by how much less points scatter; one freedom gives a chance."""
    monkeypatch.setattr(module, "_scatter_gain", lambda wider, narrower: scatter)
    found = known(monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", minus_2_log_evidence, ["a"]))
    gain = 10.0 - minus_2_log_evidence + scatter
    assert found.gain == pytest.approx(gain)
    assert found.chance == pytest.approx(chi2.sf(max(gain, 0.0), 1))


def test_of_what_is_freed_it_is_how_far_it_is_from_what_was_stated(monkeypatch):
    """Of all that only the hypothesis estimates, squares and freedoms together."""
    squares = {"b": (5.0, 4), "c": (7.0, 9)}
    monkeypatch.setattr(module, "state_step", lambda problem, before, after: "step")
    monkeypatch.setattr(module, "_squared_distance", lambda solution, step, name: squares[name])
    found = known(monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", 3.0, ["a", "b", "c"]))
    assert found.gain == 12.0
    assert found.chance == pytest.approx(chi2.sf(12.0, 13))


def test_other_views_have_other_likelihoods(monkeypatch):
    """Nothing is compared."""
    assert known(monkeypatch, solution_of("narrower"), solution_of("wider", views=4)) is None


def test_scatter_counts_by_its_squares_or_their_logarithm(monkeypatch):
    """Where sigmas are stated by the squares, else by how many times less, for each freedom; of none not at all."""
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


def test_scatter_is_that_of_all_points_in_space(monkeypatch):
    """Of every group of them, by what their sigmas are; pixels have none."""
    groups = [
        build_problem(made.cell, made.recording)[0].groups[0]
        for made in (simulate(Scenario(samples=2, target=target), 0) for target in ("points3d", "charuco", "points3d"))
    ]
    estimates = [{"stated": (1.0, 2)}, {"stated": (100.0, 200)}, {"stated": (4.0, 8), "point_m": (16.0, 32)}]

    def view_estimates(problem, group, state):
        """Squares and freedoms of each."""
        of = estimates[[id(g) for g in groups].index(id(group))]
        return {name: SimpleNamespace(white=white, white_count=count) for name, (white, count) in of.items()}

    monkeypatch.setattr(module, "view_estimates", view_estimates)
    solution = SimpleNamespace(problem=SimpleNamespace(groups=groups), state=None)
    assert module._scatter(solution) == {"stated": (5.0, 10), "point_m": (16.0, 32)}


@pytest.mark.parametrize("size", [6, 3])
def test_what_is_freed_is_off_by_its_part_of_the_step_in_sigmas(size):
    """Of a point's mount the translation alone."""
    step, sigma = np.array([3e-3, -1e-3, 5e-4, 0.01, 0.0, -0.02]), np.array([1e-3, 2e-3, 5e-4, 0.01, 0.02, 0.01])
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={"a_from_b": slice(1, 1 + size)}),
        covariance=np.diag(np.append(7.0, sigma[:size] ** 2)),
    )
    squared, count = module._squared_distance(solution, np.append(9.0, step[:size]), "a_from_b")
    assert squared == pytest.approx(np.sum((step[:size] / sigma[:size]) ** 2))
    assert count == size
