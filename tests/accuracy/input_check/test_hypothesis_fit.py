"""Tests of `fit_hypothesis`: view errors, their trimmed rms, and plausibility of a fit."""

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


def test_trimmed_rms_and_rms():
    """The trimmed rms covers the best seven of ten views, the rms all of them."""
    found = HypothesisFit(None, np.array([1.0] * 7 + [5.0] * 3), np.arange(10), False)
    assert found.trimmed_rms == pytest.approx(1.0)
    assert found.rms == pytest.approx(np.sqrt((7 + 75) / 10))


def test_wording_of_errors():
    """Errors are stated in pixels, or as a length per metre; an infinite error is "not at all"."""
    assert fit(1.234e-3, True).error_in_words() == "1.2 px"
    assert fit(1.234e-3).error_in_words() == "1.2 mm/m (mrad)"
    assert fit(np.inf).error_in_words() == "not at all"


@pytest.mark.parametrize(("off", "in_pixels", "expected"), [
    (2.9e-3, True, True), (3.1e-3, True, False), (2.9e-2, False, True), (3.1e-2, False, False),
])  # fmt: skip
def test_plausibility_limit_of_errors(off, in_pixels, expected):
    """Errors are plausible up to three pixels or three hundredths of a radian."""
    assert is_plausible(fit(off, in_pixels)) is expected


def test_plausibility_of_fit():
    """A plausible fit converged with finite cost, at most four stated sigmas; estimated sigmas have no limit."""
    assert not is_plausible(fit(1e-3, converged=False))
    assert not is_plausible(fit(1e-3, cost=np.inf))
    assert is_plausible(fit(1e-3, cost=30 * 3.9**2))
    assert not is_plausible(fit(1e-3, cost=30 * 4.1**2))
    assert is_plausible(fit(1e-3, cost=1e9, noise=SimpleNamespace(estimated=("pixel_px",))))
    assert residual_ratio(SimpleNamespace(cost=9.0, dof=0)) == 3.0


def test_inverted_eye_poses_make_fit_implausible():
    """Held-out views of a board are within the pixel noise; inverted eye poses make the fit implausible."""
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


def test_fit_starts_from_given_state():
    """A fit from the true state reaches the same optimum; held-out errors are larger than fitted ones."""
    made = simulate(Scenario(samples=12), 0)
    problem, _ = build_problem(made.cell, made.recording)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    found, unguided = (fit_hypothesis(made.cell, problem, STATED, s) for s in (start, None))
    assert found.solution.cost == pytest.approx(unguided.solution.cost, rel=1e-6)
    np.testing.assert_allclose(found.errors, unguided.errors, rtol=1e-3)
    assert found.rms > np.sqrt(np.mean(view_errors(problem, problem.groups[0], found.solution.state) ** 2))


def test_single_far_view_does_not_affect_others():
    """With one of twenty hand poses 5 cm off, the other views are predicted as if it were absent."""
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


def test_recording_without_views_has_no_fit():
    """A recording without views has no fit."""
    made = simulate(Scenario(samples=4), 0)
    assert fit_hypothesis(made.cell, build_problem(made.cell, Recording())[0], STATED) is None


@pytest.mark.parametrize(
    ("near", "predicted", "off"), [(True, [3.0], [3.0]), (True, None, [1.0, 2.0]), (False, [3.0], [1.0, 2.0])]
)
def test_errors_are_held_out_if_fit_is_near(monkeypatch, near, predicted, off):
    """Errors are held out if the fit is near the data; else, and if no hold-out is possible, they are fitted errors."""
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


def test_each_fold_predicts_its_held_out_views(monkeypatch):
    """Each fold predicts the views that it was not fitted to; without a split there are no held-out errors."""
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
def test_fit_is_repeated_without_far_views(monkeypatch, far, times):
    """A fit is repeated without the views beyond the best 70 %, at most twice.

    It is repeated if the rms is over twice the trimmed rms.
    """
    off = [np.array([*[1.0] * (12 - len(far)), *far]), np.zeros(0)]
    groups = [SimpleNamespace(k=0, take=lambda rows: range(len(rows))), SimpleNamespace(k=1, take=lambda rows: ())]
    kept = []

    def solve(problem, state, settings):
        """The rest, in which the same views are far off as before."""
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


def test_squares_of_samples_are_means_over_views():
    """Squares of a sample are means over its views; samples not requested are ignored, and NaN counts as 1000."""
    off, sample = np.array([1.0, 3.0, 2.0, np.nan, 5.0]), np.array([4, 4, 7, 9, 5])
    found = HypothesisFit(None, off, sample, False).squares(np.array([4, 7, 9]))
    np.testing.assert_allclose(found, [5.0, 4.0, 1e6])
