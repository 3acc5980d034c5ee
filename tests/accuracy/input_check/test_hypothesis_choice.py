"""Which fitted hypotheses are named, by how well they predict, what they move and what cannot be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.input_check import hypothesis_choice
from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_choice import (
    TriedHypothesis,
    compare_readings,
    decide_hypotheses,
    has_tail,
)
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.model_comparison.comparison import Decision
from basecal.effects.faces.effect import FIX
from basecal.geometry import SE3

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


def findings_about(declared, *others, impossible=(), nested=False, code="inverted", explained=False, still=frozenset()):
    """Findings about other readings."""
    cell = SimpleNamespace(requested_transforms=(ASKED,), mount_name=lambda name: "mount")
    tried = []
    for k, other in enumerate(others):
        about = ("eye", f"hand{k}")
        reading = ConventionHypothesis(code, about, f"words {k}", "fix", "tell", lambda reading: reading, nested)
        tried.append(TriedHypothesis(reading, other, ()))
    return decide_hypotheses(cell, TriedHypothesis(AS_DECLARED, declared, impossible), tried, explained, still)


def decided(declared, other, impossible=(), nested=False, code="inverted"):
    """Codes of the findings about one other reading."""
    found = findings_about(declared, other, impossible=impossible, nested=nested, code=code)
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
    assert decided(predicted(1e-3), predicted(core, moved=50), nested=True) == found


def test_facts_decide_between_equals():
    """Where the declared reading contradicts a fact, one that predicts as well is named, a wider one is not."""
    assert decided(predicted(1e-3), predicted(1.09e-3), impossible=("reach 9 m",)) == ["inverted"]
    assert decided(predicted(1e-3), predicted(1.11e-3), impossible=("reach 9 m",)) == []
    assert decided(predicted(1e-3), predicted(1e-3), impossible=("reach 9 m",), nested=True) == []


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
    errors = "0.5 mm a metre (or mrad) instead of 1 mm a metre (or mrad)"
    assert found.message == f"Words 0. Under this hypothesis the cross-validation error is {errors}. Fix. {FIX}"


def test_what_cannot_be_is_said():
    """Where a reading only fits as well, but the declared one contradicts facts."""
    (found,) = findings_about(predicted(1e-3), predicted(1e-3), impossible=("a reach of 9 m", "a board in a wall"))
    assert found.message == (
        "Words 0. As declared it fits as well, but a reach of 9 m and a board in a wall is implausible. Fix. "
        "Or let `basecal fix CELL` do so."
    )
    assert found.severity == "error"


def test_a_wider_model_beside_what_is_implausible_is_an_error():
    """No noise could explain the declared reading."""
    (found,) = findings_about(predicted(0.04), predicted(0.021, moved=5), nested=True)
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
    assert f"words 0 (inverted: 1 mm a metre (or mrad), {ASKED} 5 mm away) or words 1" in found.message
    assert f"{ASKED} 7 mm away" in found.message
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
        found = decide_hypotheses(cell, TriedHypothesis(AS_DECLARED, predicted(1e-3), ()), [tried])
        assert [f.code for f in found] == codes


@pytest.mark.parametrize(
    ("core", "whole", "tail"), [(1e-3, 1.9e-3, False), (1e-3, 2.1e-3, True), (np.inf, np.inf, False)]
)
def test_a_tail_is_twice_as_far_off_as_most(core, whole, tail):
    """Where anything is predicted at all."""
    assert has_tail(SimpleNamespace(core=core, rms=whole)) == tail


def test_readings_are_compared_by_the_samples_that_both_have():
    """Each sample by the mean square of its views; what is no number counts as far off."""
    one = replace(predicted(1e-3), sample=np.repeat(np.arange(5), 2))
    other = replace(predicted(2e-3), sample=np.repeat(np.arange(2, 7), 2))
    np.testing.assert_allclose(one.squares(np.arange(2, 5)), 1e-6)
    assert compare_readings("", one, other).is_taken
    lost = replace(one, off=np.where(np.arange(10) < 4, np.nan, one.off))
    np.testing.assert_allclose(lost.squares(np.arange(5)), [1e6, 1e6, 1e-6, 1e-6, 1e-6])
    assert compare_readings("", other, one).decision is Decision.KEEP


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
    found = findings_about(predicted(1e-3), predicted(0.5e-3, moved=9), nested=True, explained=explained)
    assert [f.severity for f in found] == ([] if severity is None else [severity])
