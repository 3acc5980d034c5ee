"""Tests of finding gross outliers with their reasons, and of leaving clean data unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CandidateObservation, PixelObservation, Recording, RobotState
from basecal.estimation.outliers import robust_solve
from basecal.estimation.outliers.classify import classify_inliers
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers, select_samples
from basecal.estimation.outliers.robust_solve import judge_again, solve_robustly
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
NOISY = (3e-4, 5e-4)
BUMP = SE3.exp([0.012, -0.009, 0.006, 0.03, 0.04, -0.02])
BAD = (3, 8, 9, 14, 20, 27)


def solve_samples(cell, samples):
    problem, _ = build_problem(cell, Recording(tuple(samples)))
    return solve_robustly(problem, cell)


def bump_robot(sample, robot="eye"):
    state = RobotState(sample.robots[robot].base_from_flange @ BUMP)
    return replace(sample, robots={**sample.robots, robot: state})


def with_pixels(sample, pixels):
    (seen,) = sample.observations
    return replace(sample, observations=(replace(seen, pixels=pixels),))


def distance(first, second) -> float:
    return float(np.abs((first.inverse() @ second).log()).max())


def base_of(solution) -> SE3:
    return solution.state.transforms[BASE]


@pytest.mark.parametrize(
    "scenario",
    [
        Scenario(),
        Scenario(robot_noise=NOISY),
        Scenario(arms="stations", robot_noise=NOISY),
        Scenario(target="chessboard"),
        Scenario(target="points3d"),
        Scenario(target="pose", robot_noise=NOISY),
        Scenario(target="led", camera_mount="fixed", target_mount="fixed"),
        Scenario(state_pixel_noise=False),
        Scenario(layout="two_cameras", robot_noise=NOISY),
    ],
    ids=str,
)
def test_clean_data_give_the_plain_solution(scenario):
    """Nothing is excluded, and every bit is that of the plain solver.

    A false alarm has a chance of 3e-3 for each cell.
    """
    s = simulate(scenario, seed=1)
    problem, _ = build_problem(s.cell, s.recording)
    ours, plain = solve_robustly(problem, s.cell), solve_problem(problem, s.cell)
    assert ours.outliers == ()
    np.testing.assert_array_equal(ours.solution.covariance, plain.covariance)
    for name, transform in plain.state.transforms.items():
        np.testing.assert_array_equal(ours.solution.state.transforms[name].matrix, transform.matrix)


@pytest.mark.parametrize("target", ["charuco", "chessboard", "pose", "points3d"])
def test_bumped_samples_are_left_out(target):
    """With a robot off by 16 mm in a fifth of the samples, only these are excluded.

    The base is that of the others to 1e-6.
    """
    s = simulate(Scenario(target=target, robot_noise=NOISY), seed=2)
    samples = [bump_robot(x) if x.sample in BAD else x for x in s.recording.samples]
    ours = solve_samples(s.cell, samples)
    assert {o.sample for o in ours.outliers if not o.ids} == set(BAD)
    assert ours.outliers[0].sigmas > 5
    assert 0.01 < ours.outliers[0].off_m < 0.1  # 16 mm, and 54 mrad over the lever to the target
    clean = solve_samples(s.cell, [x for x in samples if x.sample not in BAD])
    assert distance(base_of(ours.solution), base_of(clean.solution)) < 1e-6


def test_bumped_stop_of_a_still_arm_is_left_out():
    """The eye is still at stations, and one stop 16 mm off its reading is excluded with all of its samples."""
    s = simulate(Scenario(samples=30, arms="stations", stations=6, robot_noise=NOISY), seed=3)
    eye = [x.robots["eye"].base_from_flange for x in s.recording.samples]
    stop = [x.sample for x, pose in zip(s.recording.samples, eye, strict=True) if distance(pose, eye[7]) < 1e-9]
    assert 3 < len(stop) < 8
    samples = [bump_robot(x) if x.sample in stop else x for x in s.recording.samples]
    assert {o.sample for o in solve_samples(s.cell, samples).outliers} == set(stop)


@pytest.mark.journey
def test_mispaired_samples_are_left_out():
    """Six samples with exchanged views are metres off and are found."""
    s = simulate(Scenario(robot_noise=NOISY), seed=4)
    samples = list(s.recording.samples)
    views = [samples[k].observations for k in BAD]
    for k, view in zip(BAD, [*views[1:], views[0]], strict=True):
        samples[k] = replace(samples[k], observations=view)
    ours = solve_samples(s.cell, samples)
    assert {o.sample for o in ours.outliers if not o.ids} == set(BAD)
    assert distance(base_of(ours.solution), s.truth[BASE]) < 0.01


@pytest.mark.journey
@pytest.mark.parametrize(("mounts", "count"), [("fixed", 7), ("free", 9)])
def test_reflections_instead_of_the_led_are_left_out(mounts, count):
    """Seven or nine of thirty LED views are random bright spots, with mounts known or not. Only these are excluded."""
    s = simulate(Scenario(target="led", camera_mount=mounts, target_mount=mounts, samples=30), seed=5)
    rng = np.random.default_rng(5)
    bad = set(rng.choice(30, count, replace=False).tolist())
    samples = [
        with_pixels(x, rng.uniform((0, 0), (1280, 720), (1, 2))) if x.sample in bad else x for x in s.recording.samples
    ]
    ours = solve_samples(s.cell, samples)
    assert {o.sample for o in ours.outliers} == bad
    assert ours.outliers[0].off_px > 5
    assert distance(base_of(ours.solution), s.truth[BASE]) < 0.005


@pytest.mark.journey
def test_led_candidates_are_chosen_again_at_the_robust_state():
    """Each view has two candidates, with the LED second in half of them.

    All choices are right though five views show no LED.
    """
    s = simulate(Scenario(target="led", camera_mount="fixed", target_mount="fixed", samples=30), seed=6)
    rng = np.random.default_rng(6)
    samples = []
    for x in s.recording.samples:
        (seen,) = x.observations
        spots = np.concatenate([seen.pixels, rng.uniform((0, 0), (1280, 720), (1, 2))])
        if x.sample in BAD[:5]:
            spots = rng.uniform((0, 0), (1280, 720), (2, 2))
        spots = spots[::-1] if x.sample % 2 else spots
        samples.append(replace(x, observations=(CandidateObservation(seen.camera, seen.target, spots),)))
    ours = solve_samples(s.cell, samples)
    assert {o.sample for o in ours.outliers} == set(BAD[:5])


@pytest.mark.journey
@pytest.mark.parametrize("state_pixel_noise", [True, False])
def test_wrong_ids_and_stray_points_are_left_out(state_pixel_noise):
    """In each view two points have exchanged ids and three are off by 3 px or more.

    They are excluded, and at most 1 % of the others.
    """
    s = simulate(Scenario(robot_noise=NOISY, state_pixel_noise=state_pixel_noise), seed=7)
    rng = np.random.default_rng(7)
    samples, wrong = [], {}
    for x in s.recording.samples:
        (seen,) = x.observations
        pixels, rows = seen.pixels.copy(), rng.permutation(len(seen.ids))[:5]
        pixels[rows[:2]] = pixels[rows[1::-1]]
        pixels[rows[2:]] += rng.choice([-1, 1], (3, 2)) * rng.uniform(3, 60, (3, 2))
        samples.append(with_pixels(x, pixels))
        wrong[x.sample] = set(seen.ids[rows].tolist())
    ours = solve_samples(s.cell, samples)
    assert all(o.ids for o in ours.outliers)
    found = {o.sample: set(o.ids) for o in ours.outliers}
    assert all(ids <= found[sample] for sample, ids in wrong.items())
    assert sum(len(found[k] - wrong[k]) for k in wrong) <= 0.01 * 31 * 30
    assert distance(base_of(ours.solution), s.truth[BASE]) < 0.01


@pytest.mark.journey
def test_points_excluded_by_a_biased_lens_are_readmitted():
    """A pose recorded twice biases a free lens, so that precise corners disagree. Only its view stays excluded."""
    sharp = Scenario(samples=16, intrinsics="free", robot_noise=(1e-4, 1e-4), pixel_px=0.01, state_pixel_noise=False)
    s = simulate(sharp, seed=0)
    samples = list(s.recording.samples)
    samples[8] = replace(samples[8], robots={**samples[8].robots, "hand": samples[2].robots["hand"]})
    found = solve_samples(s.cell, samples)
    assert [(o.sample, o.ids) for o in found.outliers] == [(8, ())]


def test_chessboard_ids_are_those_of_the_recording():
    """A view recorded from the opposite end of the board names its stray point by its recorded id."""
    s = simulate(Scenario(target="chessboard"), seed=8)
    samples = list(s.recording.samples)
    for k in (4, 11):
        (seen,) = samples[k].observations
        pixels = seen.pixels[::-1].copy() if k == 11 else seen.pixels.copy()
        pixels[2] += 25
        samples[k] = with_pixels(samples[k], pixels)
    found = solve_samples(s.cell, samples).outliers
    assert [(o.sample, o.ids) for o in found] == [(4, (2,)), (11, (2,))]


def test_wrong_corner_of_few_costs_only_that_corner():
    """For targets of five to eight points one stray point is excluded, and the view stays."""
    s = simulate(Scenario(target="points", robot_noise=NOISY), seed=9)
    samples = list(s.recording.samples)
    for k in BAD:
        pixels = samples[k].observations[0].pixels.copy()
        pixels[1] += (6, -4)
        samples[k] = with_pixels(samples[k], pixels)
    ours = solve_samples(s.cell, samples)
    assert [o.sample for o in ours.outliers] == list(BAD)
    assert all(o.ids == (int(samples[o.sample].observations[0].ids[1]),) for o in ours.outliers)
    assert ours.outliers[0].off_px > 5


@pytest.mark.journey
def test_too_small_sigmas_do_not_make_outliers():
    """Unmodelled robot noise twenty times the pixel noise is no outlier: the majority sets the scale."""
    s = simulate(Scenario(robot_noise=NOISY, state_robot_noise=False, pixel_px=0.04), seed=10)
    problem, _ = build_problem(s.cell, s.recording)
    assert solve_robustly(problem, s.cell).outliers == ()


@pytest.mark.slow
def test_more_than_half_wrong_is_no_answer():
    """Twenty of thirty samples have views of another instant.

    Nothing is excluded, and the plain solution is returned.
    """
    s = simulate(Scenario(), seed=11)
    samples = list(s.recording.samples)
    order = np.random.default_rng(11).permutation(20)
    for k in range(20):
        samples[k] = replace(samples[k], observations=s.recording.samples[order[k - 1]].observations)
    ours = solve_samples(s.cell, samples)
    assert ours.outliers == ()
    assert ours.solution.cost > 100 * ours.solution.dof


def test_sample_order_has_no_effect():
    """In reversed order, the same samples are excluded, and the base is the same to 1e-9."""
    s = simulate(Scenario(robot_noise=NOISY), seed=12)
    samples = [replace(bump_robot(x) if x.sample in BAD else x, stamp_s=None) for x in s.recording.samples]
    one, other = solve_samples(s.cell, samples), solve_samples(s.cell, samples[::-1])
    assert one.outliers == other.outliers
    assert distance(base_of(one.solution), base_of(other.solution)) < 1e-9


def test_samples_are_selected_by_number():
    """A problem of some samples has their views and no others."""
    s = simulate(Scenario(), seed=13)
    problem, _ = build_problem(s.cell, s.recording)
    few = select_samples(problem, np.array([2, 5]))
    assert few.groups[0].sample.tolist() == [2, 5]
    assert isinstance(s.recording.samples[2].observations[0], PixelObservation)


def test_alternating_view_is_left_out(monkeypatch):
    """If two inlier sets lead to each other, the smaller one is the result, as soon as the first recurs."""
    made = simulate(Scenario(samples=20), 0)
    problem, _ = build_problem(made.cell, made.recording)
    plain = solve_problem(problem, made.cell)
    judged = classify_inliers(plain.problem, plain.state, all_inliers(plain.problem))
    fewer = InlierMask((np.arange(20) != 7,), judged.kept.points)
    given = []

    def in_turns(full, state, kept):
        given.append(fewer if kept.same_as(judged.kept) else judged.kept)
        return replace(judged, kept=given[-1])

    monkeypatch.setattr("basecal.estimation.outliers.robust_solve.classify_inliers", in_turns)
    robust = solve_robustly(problem, made.cell, plain=plain)
    assert [each.sample for each in robust.outliers] == [7]
    assert len(given) == 3


def test_excluded_items_are_judged_again_with_other_sigmas(monkeypatch):
    """The second judgement starts from the former consensus.

    It is None if nothing was excluded, or if the result is less observable or not converged.
    """
    s = simulate(Scenario(samples=14, robot_noise=NOISY), seed=3)
    samples = [bump_robot(x) if x.sample == 5 else x for x in s.recording.samples]
    problem, _ = build_problem(s.cell, Recording(tuple(samples)))
    robust = solve_robustly(problem, s.cell)
    assert [each.sample for each in robust.outliers] == [5]
    again = judge_again(robust, robust.solution, problem, s.cell)
    assert [each.sample for each in again.outliers] == [5]
    assert distance(base_of(again.solution), base_of(robust.solution)) < 1e-6
    assert judge_again(replace(robust, consensus=None), robust.solution, problem, s.cell) is None
    end = robust.consensus
    seen = end.solution.observability
    blind = replace(end.solution, observability=replace(seen, unobservable=frozenset({BASE})))
    for solution, is_acceptable in (
        (end.solution, True),
        (replace(end.solution, converged=False), False),
        (blind, False),
        (replace(end.solution, cost=1e9), False),
    ):
        monkeypatch.setattr(robust_solve, "_find_consensus", lambda *given, to=solution: replace(end, solution=to))
        found = judge_again(robust, robust.solution, problem, s.cell)
        assert (found is not None) == is_acceptable
    monkeypatch.setattr(robust_solve, "_find_consensus", lambda *given: replace(end, solution=blind))
    before = replace(robust, consensus=replace(end, solution=blind))
    assert judge_again(before, robust.solution, problem, s.cell) is not None


def test_state_that_contradicts_all_points_is_wrong(monkeypatch):
    """If no point would be left, all are kept, and samples are judged."""
    monkeypatch.setattr(
        robust_solve,
        "agreeing_points",
        lambda problem, *_: [np.zeros_like(m) for m in all_inliers(problem).points],
    )
    s = simulate(Scenario(robot_noise=NOISY), seed=12)
    ours = solve_samples(s.cell, [bump_robot(x) if x.sample in BAD else x for x in s.recording.samples])
    assert {o.sample for o in ours.outliers} == set(BAD)
