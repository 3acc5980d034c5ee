"""How well a hypothesis predicts views: their distances, what of them counts, and what is plausible."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.rewriting import inverted, with_robots

from basecal.accuracy.input_check import hypothesis_fit as module
from basecal.accuracy.input_check.hypothesis_fit import (
    HypothesisFit,
    fit_hypothesis,
    is_plausible,
    residual_ratio,
)
from basecal.accuracy.input_check.view_errors import view_errors
from basecal.cell import Recording, RobotState
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import STATED
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def fit(off, in_pixels=False, **solution):
    usual = {"converged": True, "cost": 30.0, "dof": 30, "noise": SimpleNamespace(estimated=())}
    return HypothesisFit(SimpleNamespace(**usual | solution), np.full(10, off), np.arange(10), in_pixels)


def test_core_and_whole():
    """Rms of the seven best of ten, and of all."""
    found = HypothesisFit(None, np.array([1.0] * 7 + [5.0] * 3), np.arange(10), False)
    assert found.trimmed_rms == pytest.approx(1.0)
    assert found.rms == pytest.approx(np.sqrt((7 + 75) / 10))


def test_errors_in_words():
    """Pixels, or a length a metre; nothing finite is nothing predicted."""
    assert fit(1.234e-3, True).error_in_words() == "1.2 px"
    assert fit(1.234e-3).error_in_words() == "1.2 mm/m (mrad)"
    assert fit(np.inf).error_in_words() == "not at all"


@pytest.mark.parametrize(("off", "in_pixels", "expected"), [
    (2.9e-3, True, True), (3.1e-3, True, False), (2.9e-2, False, True), (3.1e-2, False, False),
])  # fmt: skip
def test_plausible_errors(off, in_pixels, expected):
    """Three pixels, or three hundredths of a radian."""
    assert is_plausible(fit(off, in_pixels)) is expected


def test_plausible_fits():
    """An optimum, of finite cost, of four stated sigmas at most; sigmas that are estimated may be anything."""
    assert not is_plausible(fit(1e-3, converged=False))
    assert not is_plausible(fit(1e-3, cost=np.inf))
    assert is_plausible(fit(1e-3, cost=30 * 3.9**2))
    assert not is_plausible(fit(1e-3, cost=30 * 4.1**2))
    assert is_plausible(fit(1e-3, cost=1e9, noise=SimpleNamespace(estimated=("pixel_px",))))
    assert residual_ratio(SimpleNamespace(cost=9.0, dof=0)) == 3.0


def test_what_is_declared_rightly_predicts_and_what_is_not_does_not():
    """A board's held-out views are within the pixels' noise; with the eye's poses inverted the fit is implausible."""
    made = simulate(Scenario(samples=12), 0)
    right = fit_hypothesis(made.cell, build_problem(made.cell, made.recording)[0], STATED)
    assert right is not None
    assert right.in_pixels
    assert right.errors.shape == (12,)
    assert 0.15e-3 < right.trimmed_rms < 0.4e-3
    assert is_plausible(right)
    mixed = build_problem(made.cell, with_robots(made.recording, {"eye": inverted}))[0]
    wrong = fit_hypothesis(made.cell, mixed, STATED)
    assert wrong is None or not is_plausible(wrong)


def test_a_fit_may_start_where_another_ended():
    """From the truth the same optimum, and held-out errors larger than those that were fitted."""
    made = simulate(Scenario(samples=12), 0)
    problem, _ = build_problem(made.cell, made.recording)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    found, unguided = (fit_hypothesis(made.cell, problem, STATED, s) for s in (start, None))
    assert found.solution.cost == pytest.approx(unguided.solution.cost, rel=1e-6)
    np.testing.assert_allclose(found.errors, unguided.errors, rtol=1e-3)
    assert found.rms > np.sqrt(np.mean(view_errors(problem, problem.groups[0], found.solution.state) ** 2))


def test_a_few_views_that_are_far_off_do_not_hide_it():
    """One of twenty with the hand 5 cm aside: the others are predicted as if it were not there."""
    made = simulate(Scenario(samples=20), 0)

    def bumped(sample):
        hand = sample.robots["hand"].base_from_flange @ SE3.exp([0.05, 0, 0, 0, 0, 0])
        return replace(sample, robots={**sample.robots, "hand": RobotState(hand)})

    samples = tuple(bumped(s) if s.sample == 2 else s for s in made.recording.samples)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    problem, _ = build_problem(made.cell, replace(made.recording, samples=samples))
    found = fit_hypothesis(made.cell, problem, STATED, start)
    assert found.trimmed_rms < 0.5e-3
    assert found.rms > 1e-2


def test_nothing_to_fit_is_no_fit():
    """Without a view there is none."""
    made = simulate(Scenario(samples=4), 0)
    assert fit_hypothesis(made.cell, build_problem(made.cell, Recording())[0], STATED) is None


@pytest.mark.parametrize(
    ("near", "predicted", "off"), [(True, [3.0], [3.0]), (True, None, [1.0, 2.0]), (False, [3.0], [1.0, 2.0])]
)
def test_errors_are_held_out_where_a_fit_is_near(monkeypatch, near, predicted, off):
    """Else, and where nothing can be held out, they are those that it was fitted to."""
    made = simulate(Scenario(samples=2, target="pose"), 0)
    held_out = None if predicted is None else (np.array(predicted), np.array([3]))
    solution = SimpleNamespace(state=None)
    monkeypatch.setattr(module, "solve_problem", lambda problem, cell, settings: solution)
    monkeypatch.setattr(module, "_concentrate", lambda solution, settings: solution)
    monkeypatch.setattr(module, "view_errors", lambda problem, group, state: np.array([1.0, 2.0]))
    monkeypatch.setattr(module, "is_near", lambda fit: near)
    monkeypatch.setattr(module, "_held_out_errors", lambda problem, solution: held_out)
    found = fit_hypothesis(made.cell, build_problem(made.cell, made.recording)[0], STATED)
    assert (found.solution, found.in_pixels) == (solution, False)
    np.testing.assert_array_equal(found.errors, off)


def test_of_folds_each_predicts_its_own_views(monkeypatch):
    """Those that it was not fitted to, one fold after the other; none where samples cannot be parted."""
    split = SimpleNamespace(folds="folds")
    groups = [SimpleNamespace(off=off, sample=np.array([off + 1])) for off in (10, 20)]
    refits = [SimpleNamespace(optimum=SimpleNamespace(state=k), views=SimpleNamespace(groups=groups)) for k in (1, 2)]
    monkeypatch.setattr(module, "instant_split", lambda problem, count: split if problem == "parted" else None)
    monkeypatch.setattr(module, "refit_folds", lambda problem, state, folds, prediction_problem: refits)
    monkeypatch.setattr(module, "view_errors", lambda problem, group, state: np.array([group.off + state]))
    solution = SimpleNamespace(problem=None, state=None)
    assert module._held_out_errors("whole", solution) is None
    off, sample = module._held_out_errors("parted", solution)
    np.testing.assert_array_equal(off, [11, 21, 12, 22])
    np.testing.assert_array_equal(sample, [11, 21, 11, 21])


@pytest.mark.parametrize(("far", "times"), [((), 0), ((5.0,), 0), ((8.0,), 2), ((30.0,) * 3, 2)])
def test_a_fit_is_repeated_without_views_far_off(monkeypatch, far, times):
    """Those beyond seven tenths of the views, twice at most, where all are off twice as far as most."""
    off = [np.array([*[1.0] * (12 - len(far)), *far]), np.zeros(0)]
    groups = [SimpleNamespace(k=0, take=lambda rows: range(len(rows))), SimpleNamespace(k=1, take=lambda rows: ())]
    kept = []

    def solve(problem, state, settings):
        """The rest, of which the same views are far off as before."""
        kept.append(problem.groups)
        return SimpleNamespace(problem=whole, state=None)

    whole = SimpleNamespace(groups=groups, with_groups=lambda groups: SimpleNamespace(groups=[*groups]))
    monkeypatch.setattr(module, "view_errors", lambda problem, group, state: off[group.k])
    monkeypatch.setattr(module, "solve_from", solve)
    first = SimpleNamespace(problem=whole, state=None)
    found = module._concentrate(first, STATED)
    assert (found is first) == (not kept)
    assert len(kept) == times
    for each in kept:
        assert [len(group) for group in each] == [np.count_nonzero(off[0] <= np.quantile(off[0], 0.7))]


def test_errors_of_samples_are_means_of_squares_over_their_views():
    """Samples that are not asked for do not count; an error without a number is a thousand."""
    off, sample = np.array([1.0, 3.0, 2.0, np.nan, 5.0]), np.array([4, 4, 7, 9, 5])
    found = HypothesisFit(None, off, sample, False).squares(np.array([4, 7, 9]))
    np.testing.assert_allclose(found, [5.0, 4.0, 1e6])
