"""How well a hypothesis predicts views: their distances, what of them counts, and what is plausible."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.accuracy.input_check.hypothesis_fit import (
    HypothesisFit,
    fit_hypothesis,
    in_order,
    off_views,
    plausible,
    ratio,
    thinned,
)
from basecal.accuracy.input_check.rewriting import inverted, with_robots
from basecal.cell import Recording, RobotState, Sample
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def fit(off, in_pixels=False, **solution):
    usual = {"converged": True, "cost": 30.0, "dof": 30, "noise": SimpleNamespace(estimated=())}
    return HypothesisFit(SimpleNamespace(**usual | solution), np.full(10, off), in_pixels)


def test_core_and_whole():
    """Rms of the seven best of ten, and of all."""
    found = HypothesisFit(None, np.array([1.0] * 7 + [5.0] * 3), False)
    assert found.core == pytest.approx(1.0)
    assert found.whole == pytest.approx(np.sqrt((7 + 75) / 10))


def test_errors_in_words():
    """Pixels, or a length a metre; nothing finite is nothing predicted."""
    assert fit(1.234e-3, True).error_in_words() == "1.23 px"
    assert fit(1.234e-3).error_in_words() == "1.23 mm a metre (or mrad)"
    assert fit(np.inf).error_in_words() == "not at all"


@pytest.mark.parametrize(("off", "in_pixels", "expected"), [
    (2.9e-3, True, True), (3.1e-3, True, False), (2.9e-2, False, True), (3.1e-2, False, False),
])  # fmt: skip
def test_plausible_errors(off, in_pixels, expected):
    """Three pixels, or three hundredths of a radian."""
    assert plausible(fit(off, in_pixels)) is expected


def test_plausible_fits():
    """An optimum, of finite cost, of four stated sigmas at most; sigmas that are estimated may be anything."""
    assert not plausible(fit(1e-3, converged=False))
    assert not plausible(fit(1e-3, cost=np.inf))
    assert plausible(fit(1e-3, cost=30 * 3.9**2))
    assert not plausible(fit(1e-3, cost=30 * 4.1**2))
    assert plausible(fit(1e-3, cost=1e9, noise=SimpleNamespace(estimated=("pixel_px",))))
    assert ratio(SimpleNamespace(cost=9.0, dof=0)) == 3.0


def test_samples_go_by_time_and_are_thinned_evenly():
    """At most so many, first and last among them; fewer stay as they are."""
    recording = Recording(tuple(Sample(k, stamp_s=10.0 - k) for k in range(11)))
    assert [s.sample for s in in_order(recording).samples] == list(range(10, -1, -1))
    assert [s.sample for s in thinned(recording, 6).samples] == [0, 2, 4, 6, 8, 10]
    assert len(thinned(recording, 20).samples) == 11


def test_poses_are_off_by_angle_and_length_over_distance():
    """Over all six numbers: a third of a radian, and a metre at two metres."""
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6))
    (group,) = problem.groups
    far = SE3.exp(np.array([[0, 0, 2.0, 0, 0, 0]] * 3))
    at = replace(group, measurement=replace(group.measurement, measured_camera_from_target=far))
    mount = {**state.transforms, "eye_flange_from_camera": SE3.exp([0, 0, -2.0, 0, 0, 0])}
    exact = replace(state, transforms=mount)
    np.testing.assert_allclose(off_views(problem, at, exact), 0.0, atol=1e-12)
    off = SE3.exp(np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0.3], [0] * 6]))
    moved = replace(at, measurement=replace(at.measurement, measured_camera_from_target=far @ off))
    np.testing.assert_allclose(off_views(problem, moved, exact)[[0, 2]] * np.sqrt(6), [0.5, 0.0], atol=0.06)
    assert off_views(problem, moved, exact)[1] * np.sqrt(6) == pytest.approx(0.3, abs=1e-9)


def of_views(target, change):
    """Distances at the truth of a recording without noise, whose measurement is changed."""
    made = simulate(Scenario(samples=4, target=target, pixel_px=0.0, point_m=0.0, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    measurement = change(group.measurement)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    distance = np.median(np.linalg.norm(state.camera_from_target(group, problem.stops).translation, axis=-1))
    return off_views(problem, replace(group, measurement=measurement), state), distance


def test_pixels_are_off_by_milliradians():
    """Corners of a view 3 px right and 4 px down are off by 5 / sqrt(2) thousandths; those not seen do not count."""

    def change(of):
        pixels, seen = of.pixels.copy(), of.seen.copy()
        pixels[1] += (3.0, 4.0)
        pixels[2, 0] += 1e4
        seen[2, 0] = False
        return replace(of, pixels=pixels, seen=seen)

    np.testing.assert_allclose(of_views("charuco", change)[0], [0, 5e-3 / np.sqrt(2), 0, 0], atol=1e-9)


def test_3d_points_are_off_over_their_distance():
    """Points of a view 3 cm off: a third of the square each coordinate, over how far points are."""

    def change(of):
        points, seen = of.points_in_camera.copy(), of.seen.copy()
        points[1] += (0.03, 0.0, 0.0)
        points[3, 0] += 9.0
        seen[3, 0] = False
        return replace(of, points_in_camera=points, seen=seen)

    off, distance = of_views("points3d", change)
    np.testing.assert_allclose(off[[0, 2, 3]], 0.0, atol=1e-9)
    assert off[1] == pytest.approx(0.03 / np.sqrt(3) / distance, rel=0.25)


def test_robots_are_taken_as_recorded():
    """The errors of stops that explain a view count against a hypothesis."""
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6), stop_sigma=np.full(6, 0.1))
    shifted = replace(state, stop_errors=np.ones((2, 6)))
    np.testing.assert_array_equal(
        off_views(problem, problem.groups[0], shifted), off_views(problem, problem.groups[0], state)
    )


def test_what_is_declared_rightly_predicts_and_what_is_not_does_not():
    """A board's held-out views are within the pixels' noise; with the eye's poses inverted the fit is implausible."""
    made = simulate(Scenario(samples=12), 0)
    settings = Settings(robot_noise="stated")
    right = fit_hypothesis(made.cell, made.recording, settings)
    assert right is not None
    assert right.in_pixels
    assert right.off.shape == (12,)
    assert 0.15e-3 < right.core < 0.4e-3
    assert plausible(right)
    wrong = fit_hypothesis(made.cell, with_robots(made.recording, {"eye": inverted}), settings)
    assert wrong is None or not plausible(wrong)


def test_a_fit_may_start_where_another_ended():
    """From the truth the same optimum, and held-out errors larger than those that were fitted."""
    made = simulate(Scenario(samples=12), 0)
    problem, _ = build_problem(made.cell, made.recording)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    settings = Settings(robot_noise="stated")
    found, unguided = (fit_hypothesis(made.cell, made.recording, settings, s) for s in (start, None))
    assert found.solution.cost == pytest.approx(unguided.solution.cost, rel=1e-6)
    np.testing.assert_allclose(found.off, unguided.off, rtol=1e-3)
    assert found.whole > np.sqrt(np.mean(off_views(problem, problem.groups[0], found.solution.state) ** 2))


def test_a_few_views_that_are_far_off_do_not_hide_it():
    """One of twenty with the hand 5 cm aside: the others are predicted as if it were not there."""
    made = simulate(Scenario(samples=20), 0)

    def bumped(sample):
        hand = sample.robots["hand"].base_from_flange @ SE3.exp([0.05, 0, 0, 0, 0, 0])
        return replace(sample, robots={**sample.robots, "hand": RobotState(hand)})

    samples = tuple(bumped(s) if s.sample == 2 else s for s in made.recording.samples)
    start = State(made.truth, made.cameras, np.zeros((0, 6)))
    found = fit_hypothesis(made.cell, replace(made.recording, samples=samples), Settings(), start)
    assert found.core < 0.5e-3
    assert found.whole > 1e-2


def test_nothing_to_fit_is_no_fit():
    """Without a view there is none, nor where camera and target hang on one arm."""
    made = simulate(Scenario(samples=4), 0)
    assert fit_hypothesis(made.cell, Recording(), Settings()) is None
    board = replace(made.cell.targets["board"], on="eye")
    assert fit_hypothesis(replace(made.cell, targets={"board": board}), made.recording, Settings()) is None
