"""Tests of held-out station scores: stations are predicted from the rest, and scored by their own noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem
from tests.touch_cells import MARKS, recorded, state, touch_cell, touch_lines

from basecal.accuracy.cross_validation.folds import place_split, splits
from basecal.accuracy.cross_validation.station_scores import StationScores, place_errors, score_stations
from basecal.cell import Unknown
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution, solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def score_problem(problem: Problem, state: State) -> StationScores:
    return score_stations(problem, state, next(splits(problem)), 100)


@pytest.mark.parametrize("target", ["charuco", "led", "pose"])
@pytest.mark.parametrize("noise", [(0.0, 0.0), (3e-4, 5e-4)])
def test_true_model_scores_match_noise(target, noise):
    """The mean of x = exp(score) - 1 over 40 stations is near 1 for the true model, with and without robot noise.

    With 40 stations of 2 to 6 freedoms the mean of x has a standard error of at most 0.16. Fits to 32 samples with up
    to 18 unknowns raise it by up to 18 / (6 * 32), or for an LED 15 / (2 * 32): from 0.5 to 2.
    """
    made = simulate(Scenario(samples=40, target=target, robot_noise=noise), 2)
    solution = solve(made.cell, made.recording)
    scores = score_problem(solution.problem, solution.state).scores
    assert 0.5 < np.mean(np.expm1(scores)) < 2.0


def test_prediction_is_independent_of_start():
    """The prediction is independent of the initial state and its stop errors: held-out views have no part in it."""
    made = simulate(Scenario(samples=30, robot_noise=(3e-4, 5e-4)), 1)
    solution = solve(made.cell, made.recording)
    problem, state = solution.problem, solution.state
    elsewhere = State(made.truth, state.cameras, 3 * np.ones_like(state.stop_errors))
    one, other = (score_problem(problem, start).scores for start in (state, elsewhere))
    np.testing.assert_allclose(one, other, rtol=1e-4)
    assert np.all(one > 0)


def test_wrong_sample_has_worst_score():
    """A robot pose off by 5 mm has by far the worst score, though the fits to others hold it.

    Its distance shows it, too.
    """
    made = simulate(Scenario(samples=30), 0)
    first = made.recording.samples[0]
    eye = first.robots["eye"]
    wrong = replace(eye.base_from_flange, translation=eye.base_from_flange.translation + np.array([5e-3, 0, 0]))
    bad = replace(first, robots={**first.robots, "eye": replace(eye, base_from_flange=wrong)})
    recording = replace(made.recording, samples=(bad, *made.recording.samples[1:]))
    solution = solve(made.cell, recording)
    found = score_problem(solution.problem, solution.state)
    assert np.argmax(found.scores) == 0
    assert found.scores[0] > np.sort(found.scores)[-2] + 2
    assert np.max(found.distance_m) > 3e-3


def test_scores_are_those_of_predicted_poses():
    """For poses of a fixed mount each station's score is log(1 + d^2 / 6); the mean square is that of all numbers."""
    errors = np.random.default_rng(0).standard_normal((12, 6))
    problem, state = pose_problem(1e-3 * errors, np.full(6, 1e-3), Unknown("prior", SE3.identity(), np.full(6, 1e-9)))
    found = score_problem(problem, state)
    np.testing.assert_allclose(found.scores, np.log1p(np.sum(errors**2, -1) / 6), rtol=2e-3)
    assert found.mean_square == pytest.approx(np.mean(errors**2), rel=2e-3)
    np.testing.assert_allclose(
        np.sort(found.distance_m), np.sort(1e-3 * np.linalg.norm(errors[:, :3], axis=-1)), rtol=2e-3
    )


def test_robot_noise_adds_to_view_noise():
    """With stops twice as uncertain as views, squares are over five variances, and distances are unchanged."""
    errors = np.random.default_rng(0).standard_normal((12, 6))
    prior = Unknown("prior", SE3.identity(), np.full(6, 1e-9))
    problem, state = pose_problem(1e-3 * errors, np.full(6, 1e-3), prior, stop_sigma=np.full(6, 2e-3))
    found = score_problem(problem, state)
    np.testing.assert_allclose(found.scores, np.log1p(np.sum(errors**2, -1) / 5 / 6), rtol=5e-3)
    assert found.mean_square == pytest.approx(np.mean(errors**2) / 5, rel=5e-3)
    np.testing.assert_allclose(
        np.sort(found.distance_m), np.sort(1e-3 * np.linalg.norm(errors[:, :3], axis=-1)), rtol=5e-3
    )


SIGMA_M = 2e-4
FIVE = {**MARKS, "mark_d": np.array([0.6, 0.0, 0.2]), "mark_e": np.array([0.4, 0.25, 0.1])}


def solution(bend_rad: float, count: int = 80) -> Solution:
    """A solution of touches of five marks; poses at `mark_e` are recorded rotated about x of the base."""
    lines, error = touch_lines(np.random.default_rng(0), count, SIGMA_M, FIVE, True), SE3.exp([0, 0, 0, bend_rad, 0, 0])
    for line in lines:
        if line["observations"][0]["touch"] == "mark_e":
            ((robot, robot_state),) = line["robots"].items()
            pose = robot_state["base_from_flange"]
            true = SE3.from_quaternion(pose["q_xyzw"], pose["t_m"])
            line["robots"] = {robot: state(SE3(error.rotation @ true.rotation, true.translation))}
    cell = touch_cell(list(FIVE))
    return solve(cell, recorded(cell, lines))


def test_place_errors_match_expectation():
    """Ratios of 80 touches of five marks have an rms of 1 within one part in seven, and none is above 1.5."""
    found = place_errors(solution(0.0), 50)
    ratios = np.array([each.ratio for each in found])
    assert {each.mark for each in found} == set(FIVE)
    assert np.sqrt(np.mean(ratios**2)) == pytest.approx(1.0, abs=0.15)
    assert ratios.max() < 1.5


def test_robot_error_at_one_place_is_found():
    """A rotation by 10 mrad at one mark, about 1 mm at a tip of 150 mm, makes it the worst mark by far."""
    worst = max(place_errors(solution(1e-2), 50), key=lambda each: each.ratio)
    assert worst.mark == "mark_e"
    assert worst.ratio > 3
    assert 5e-4 < worst.error_m < 2e-3


def test_marks_of_plate_are_held_out_together():
    """Two marks of a plate are held out together and single marks alone; two places are too few."""
    plate = {"points_m": {"p": [0, 0, 0], "q": [0.1, 0, 0]}}
    cell = touch_cell(["mark_a", "mark_b", "mark_c"], marks={"plate": plate, "mark_a": {}, "mark_b": {}, "mark_c": {}})
    places = {"p": np.array([0.4, 0.1, 0.2]), "q": np.array([0.5, 0.1, 0.2])}
    every = touch_lines(np.random.default_rng(0), 40, SIGMA_M, {**MARKS, **places}, True)
    split = place_split(solve(cell, recorded(cell, every)).problem)
    assert len(split.parts) == 5
    on_plate = {n for n, line in enumerate(every) if line["observations"][0]["touch"] in places}
    assert frozenset(on_plate) in split.folds
    two = touch_cell(["mark_a", "mark_b"])
    lines = touch_lines(np.random.default_rng(0), 12, SIGMA_M, {name: MARKS[name] for name in ("mark_a", "mark_b")})
    assert place_split(solve(two, recorded(two, lines)).problem) is None
    assert place_errors(solve(two, recorded(two, lines)), 20) == ()
