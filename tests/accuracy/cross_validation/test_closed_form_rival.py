"""Tests of closed-form rivals, which exist only if the answer's model is wrong."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.cross_validation.closed_form_rival import (
    _error_ratio,
    _rival,
    _squared_errors,
    closed_form_rival,
    opencv_rivals,
)
from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.refit import refit_folds
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.cell import Rival, Unknown
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MOUNT = "arm_flange_from_wrist"
# A free lens absorbs the errors of robots that are assumed exact.
NOISY = Scenario(samples=40, robot_noise=(2e-3, 1e-2), state_robot_noise=False, intrinsics="free", layout="eye_in_hand")
EXACT = Settings(robot_noise="stated")


def rival_of(solution):
    split = next(splits(solution.problem))
    return closed_form_rival(solution, refit_folds(solution.problem, solution.state, split.folds, 50))


@pytest.mark.parametrize("changed", [{}, {"target": "pose"}, {"layout": "eye_in_hand"}, {"target": "led"}])
def test_true_model_has_no_rival(changed):
    """A true model has no rival: stated noise of two arms, poses, one arm; an LED has no poses of its own."""
    made = simulate(Scenario(**{"samples": 20, "robot_noise": (2e-4, 5e-4), **changed}), 1)
    assert rival_of(solve(made.cell, made.recording)) is None


@pytest.mark.journey
def test_robots_assumed_exact_have_rival():
    """Robot errors of 2 mm and 10 mrad absorbed by the lens give a rival that predicts better, far from the answer."""
    made = simulate(NOISY, 3)
    solution = solve(made.cell, made.recording, EXACT)
    rival = cross_validate(solution, made.cell.requested_transforms, EXACT).rival
    assert rival.ratio > 1.1
    where = solution.problem.columns[MOUNT]
    sigma = np.sqrt(np.diag(solution.joint_transform_covariance([MOUNT])))
    assert np.abs(rival.moved[where] / sigma).max() > 3.0
    others = np.ones(len(rival.moved), dtype=bool)
    others[where] = others[solution.problem.columns["arm_base_from_board"]] = False
    assert not np.any(rival.moved[others])


def test_fixed_or_several_pairs_have_no_rival():
    """A closed form has nothing to solve if all is fixed, and does not cover loops of several pairs."""
    made = simulate(Scenario(samples=12, layout="eye_in_hand", camera_mount="fixed", target_mount="fixed"), 0)
    solution = solve(made.cell, made.recording)
    assert rival_of(solution) is None
    (group,) = solution.problem.groups
    twice = replace(solution, problem=solution.problem.with_groups((group, group)))
    assert closed_form_rival(twice, []) is None


@pytest.mark.parametrize(("theirs", "count", "expected"), [
    (0.5, 20, np.sqrt(2)), (0.9, 20, None), (2.0, 20, None), (0.5, 5, None), (np.nan, 20, None),
])  # fmt: skip
def test_ratio_must_be_clear_and_significant(theirs, count, expected):
    """Half the squares is 1.41 times better.

    A tenth less is not clear, five views are few, and NaN predicts nothing.
    """
    ours = np.random.default_rng(0).uniform(0.9, 1.1, (count, 2)) * (1e-6, 1e-4)
    found = _error_ratio(ours, theirs * ours)
    assert found == (None if expected is None else pytest.approx(expected))


def test_single_better_view_is_chance():
    """If one of twenty views is ten times worse for the answer, the mean is worse but most views are not: chance."""
    ours = np.ones((20, 2))
    ours[3] = 100.0
    assert _error_ratio(ours, np.ones((20, 2))) is None


def test_exact_data_have_no_rival():
    """Errors of a nanometre and a nanoradian give no rival, whatever the ratio."""
    ours = np.full((20, 2), 1e-18) * np.random.default_rng(0).uniform(0.9, 1.1, (20, 2))
    assert _error_ratio(ours, 0.01 * ours) is None
    ours[:, 0] = 1e-6  # translations off by a millimetre, for the rival, too
    assert _error_ratio(ours, ours * (1.0, 0.0)) is None


def test_six_views_are_enough_for_rival():
    """Six views are enough if each is as much better; five are not."""
    ours = np.random.default_rng(0).uniform(0.95, 1.05, (6, 2)) * (1e-6, 1e-4)
    assert _error_ratio(ours, 0.3 * ours) == pytest.approx(np.sqrt(1 / 0.3))
    assert _error_ratio(ours[:5], 0.3 * ours[:5]) is None


def test_ratio_weighs_translation_and_rotation_equally():
    """The ratio is the root of 2 over 1.25 in any units if translations are twice as far off and rotations equal."""
    rng = np.random.default_rng(0)
    ours = rng.uniform(0.99, 1.01, (40, 2)) * (1e-4, 1e-6)
    assert _error_ratio(ours, ours * (0.25, 1.0)) == pytest.approx(np.sqrt(2 / 1.25))


def fake_answer(reference, off):
    """Exact poses of two arms about either base, an answer whose base is off, and folds that are equally off."""
    made = simulate(Scenario(samples=8, target="pose", target_mount="fixed", pose_noise=(1e-12, 1e-12)), 2)
    cell = made.cell
    if reference == "hand":
        cell = replace(cell, reference="hand", bases={"eye": Unknown()})
    problem, _ = build_problem(cell, made.recording)
    (base,) = [name for name in problem.columns if name.count("_base")]
    truth = dict(made.truth)
    truth[base] = truth["eye_base_from_hand_base"] if reference == "eye" else truth["eye_base_from_hand_base"].inverse()
    wrong = State({**truth, base: truth[base] @ SE3.exp(off)}, made.cameras, np.zeros((len(problem.stops), 6)))
    known = np.zeros(len(problem.stops), dtype=bool)
    folds = [
        SimpleNamespace(held=frozenset(held), known=known, optimum=SimpleNamespace(state=wrong))
        for held in (range(4), range(4, 8))
    ]
    return SimpleNamespace(problem=problem, state=wrong), folds, base


@pytest.mark.parametrize("reference", ["eye", "hand"])
def test_wrong_answer_is_moved_to_closed_form(reference):
    """With exact poses the answer moves by exactly the error of its base, for either reference."""
    off = np.array([3e-3, -2e-3, 1e-3, 2e-3, 1e-3, -1e-3])
    solution, folds, base = fake_answer(reference, off)
    rival = closed_form_rival(solution, folds)
    assert rival.ratio > 50
    where = solution.problem.columns[base]
    np.testing.assert_allclose(rival.moved[where], -off, atol=1e-8)
    np.testing.assert_allclose(np.delete(rival.moved, np.r_[where]), 0, atol=1e-8)


@pytest.mark.parametrize(("held", "is_found"), [(5, True), (6, False)])
def test_closed_form_needs_three_views(held, is_found):
    """A closed form needs three of eight views beside the held-out ones, and folds to compare with."""
    solution, (fold, _), _ = fake_answer("eye", np.full(6, 3e-3))
    rest = SimpleNamespace(**vars(fold) | {"held": frozenset(range(held, 8))})
    fold.held = frozenset(range(held))
    assert (closed_form_rival(solution, [fold, rest][: 1 if not is_found else 2]) is not None) == is_found
    assert closed_form_rival(solution, []) is None


def test_squared_errors_are_of_length_and_angle():
    """Squared errors are of length and angle of the predicted target about the single-view pose, in its own axes."""
    alone = SE3.from_rotvec(np.array([[0.3, 0, 0.1], [0, 1.0, 0]]), np.array([[1.0, 2, 3], [0, 0, 1]]))
    off = SE3.from_rotvec(np.array([[0, 0.3, -0.4], [0, 0, 0]]), np.array([[1.0, 2, 2], [0, 3, 0]]))
    np.testing.assert_allclose(_squared_errors(alone, alone @ off), [[9, 0.25], [9, 0]], atol=1e-12)


def rivals_of(**options: object) -> tuple[Rival, ...]:
    made = simulate(Scenario(samples=15, robot_noise=(2e-4, 5e-4), **options), 1)
    solution = solve(made.cell, made.recording)
    split = next(splits(solution.problem))
    return opencv_rivals(solution, refit_folds(solution.problem, solution.state, split.folds, 50))


def test_single_arm_has_seven_rivals() -> None:
    """A single arm has seven OpenCV rivals that predict held-out views, none much better than the answer.

    All are within the usual error of hand-eye methods.
    """
    ours, *others = rivals_of(layout="eye_in_hand")
    assert ours.name == "basecal"
    assert len(others) == 7
    assert all(0.8 * ours.target_m < other.target_m < 0.05 for other in others)
    assert all(np.isfinite(other.target_rad) for other in others)


def test_two_moving_arms_have_no_opencv_rival() -> None:
    """Two moving arms have no rival: no OpenCV method allows both to move in every view."""
    assert rivals_of(layout="dual") == ()


def test_rival_rms_covers_all_folds():
    """The rms of translation and rotation norms covers all folds; a method that fails in one fold has none."""
    one, two = np.diag([1.0, 2.0, 2.0, 3.0, 4.0, 12.0]), np.zeros((2, 6))
    rival = _rival("park", [one, two])
    np.testing.assert_allclose((rival.target_m, rival.target_rad), (np.sqrt(9 / 8), np.sqrt(169 / 8)))
    assert _rival("park", [one, None]) == Rival("park")
