"""Tests of accepting the result of an outlier search, and of selecting the best of several."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.cell import Unknown
from basecal.estimation.outliers.classify import classify_inliers
from basecal.estimation.outliers.consensus import (
    Consensus,
    _split_at_gap,
    agreeing_samples,
    best_consensus,
    has_plausible_residuals,
    is_acceptable,
    is_convincing,
    may_hide_outliers,
)
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers, inlier_problem
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=10), 0)


@pytest.fixture(scope="module")
def clean_solution():
    """The solution of a clean recording, all noise stated."""
    problem, _ = build_problem(MADE.cell, MADE.recording)
    return solve_problem(problem, MADE.cell)


def make_consensus(clean_solution, views=10, variance=1.0):
    """A consensus that keeps some of ten views, with this variance of views."""
    whole = all_inliers(clean_solution.problem)
    kept = InlierMask((np.arange(10) < views,), whole.points)
    judgement = classify_inliers(clean_solution.problem, clean_solution.state, whole)
    judgement = replace(judgement, view_scale=replace(judgement.view_scale, variance=variance))
    return Consensus(
        clean_solution.problem,
        kept,
        replace(clean_solution, problem=inlier_problem(clean_solution.problem, kept)),
        judgement,
    )


def test_six_of_ten_views_within_noise_are_convincing(clean_solution):
    """Fewer are not, nor are views that scatter by 1.5 sigmas or residuals beyond any noise."""
    assert is_convincing(make_consensus(clean_solution, 6))
    assert not is_convincing(make_consensus(clean_solution, 5))
    assert not is_convincing(make_consensus(clean_solution, 6, variance=1.6**2))
    assert not is_convincing(
        replace(make_consensus(clean_solution), solution=replace(clean_solution, cost=1e6 * clean_solution.cost))
    )
    assert not is_convincing(None)


def test_acceptable_consensus_uses_half_of_the_views(clean_solution):
    """An acceptable consensus keeps half of the views and is an optimum.

    It has the same observable transforms as with all views.
    """
    assert is_acceptable(make_consensus(clean_solution, 5), clean_solution)
    assert not is_acceptable(make_consensus(clean_solution, 4), clean_solution)
    end = make_consensus(clean_solution)
    assert not is_acceptable(replace(end, solution=replace(clean_solution, converged=False)), clean_solution)
    blind = replace(clean_solution.observability, unobservable=frozenset({"eye_flange_from_wrist"}))
    assert not is_acceptable(replace(end, solution=replace(clean_solution, observability=blind)), clean_solution)


def test_best_consensus_has_most_views_within_noise(clean_solution):
    """A result four times noisier than another comes after it, though it keeps more views."""
    ends = [make_consensus(clean_solution, 7), make_consensus(clean_solution, 9), make_consensus(clean_solution, 8)]
    assert best_consensus(ends) is ends[1]
    assert best_consensus([]) is None
    unstated = replace(clean_solution.problem, unstated=frozenset({"eye"}))
    for quiet in (1.0, 9.0):
        for times, best in ((3.9, 1), (4.1, 0)):
            ends = [
                replace(make_consensus(clean_solution, n, v), problem=unstated)
                for n, v in ((7, quiet), (10, times * quiet))
            ]
            assert best_consensus(ends) is ends[best]


@pytest.mark.parametrize(("ratio", "best"), [(1.9, 1), (2.1, 0)])
def test_unstated_noise_of_results_is_compared_in_pixels(ratio, best):
    """A result whose estimated noise is twice that of another comes after it, though each fits its own noise."""
    made = simulate(Scenario(samples=10, state_pixel_noise=False), 0)
    quiet = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
    noise = quiet.noise.noise
    louder = replace(quiet, noise=replace(quiet.noise, noise=noise._replace(pixel_px=ratio * noise.pixel_px)))
    ends = [make_consensus(quiet, 7), replace(make_consensus(quiet, 10), solution=louder)]
    assert best_consensus(ends) is ends[best]


def test_consensus_within_stated_noise_is_preferred(clean_solution):
    """A result within the stated noise is preferred to one with more views that scatter by 1.6 sigmas."""
    stated = replace(clean_solution.problem, unstated=frozenset())
    ends = [replace(make_consensus(clean_solution, n, v), problem=stated) for n, v in ((7, 1.0), (10, 1.6**2))]
    assert best_consensus(ends) is ends[0]
    assert best_consensus([replace(end, problem=clean_solution.problem) for end in ends]).kept.views[0].all()


def test_residuals_beyond_stated_noise_are_implausible(clean_solution):
    """Clean residuals are plausible, a hundred times their sigma is not."""
    assert has_plausible_residuals(clean_solution)
    assert not has_plausible_residuals(replace(clean_solution, cost=1e4 * clean_solution.cost))


def test_view_scatter_beyond_stated_noise_is_implausible(clean_solution):
    """Views within the stated noise hide no outliers, and a scatter of 1.6 sigmas may."""
    assert not may_hide_outliers(clean_solution, make_consensus(clean_solution).judgement)
    assert may_hide_outliers(clean_solution, make_consensus(clean_solution, variance=1.6**2).judgement)


def test_view_scatter_beyond_estimated_noise_is_implausible():
    """Without stated noise, whole views that scatter, or point noise beyond that of detectors, may hide outliers."""
    made = simulate(Scenario(samples=10, state_pixel_noise=False), 0)
    plain = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
    assert not may_hide_outliers(plain, make_consensus(plain).judgement)
    assert may_hide_outliers(plain, make_consensus(plain, variance=1.6**2).judgement)
    noise = replace(plain.noise, noise=plain.noise.noise._replace(pixel_px=30.0))
    assert may_hide_outliers(replace(plain, noise=noise), make_consensus(plain).judgement)


def scale_residuals(solution, ratio):
    """The solution with residuals of this ratio to their sigmas."""
    return replace(solution, cost=ratio**2 * solution.dof)


def test_limits_of_plausible_residuals():
    """The limit is 3 px for points, or 1.5 sigmas if that is more.

    It is ten sigmas for stated poses, without limit for unstated ones.
    """
    for pixel_px, most in ((0.2, 15.0), (6.0, 1.5)):
        made = simulate(Scenario(samples=6, pixel_px=pixel_px), 0)
        solution = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
        assert has_plausible_residuals(scale_residuals(solution, 0.99 * most))
        assert not has_plausible_residuals(scale_residuals(solution, 1.01 * most))
    for stated in (True, False):
        made = simulate(Scenario(samples=6, target="pose", state_observation_noise=stated), 0)
        solution = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
        assert has_plausible_residuals(scale_residuals(solution, 9.9))
        assert has_plausible_residuals(scale_residuals(solution, 10.1)) != stated


def test_estimated_pixel_noise_may_hide_outliers():
    """Estimated noise above 1 px may, slightly less does not. Noise of other types or without an estimate does not."""
    made = simulate(Scenario(samples=10, state_pixel_noise=False), 0)
    plain = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)

    def hides(pixel_px, names=("pixel_px",)):
        noise = replace(plain.noise, noise=plain.noise.noise._replace(pixel_px=pixel_px), estimated=names)
        return may_hide_outliers(replace(plain, noise=noise), make_consensus(plain).judgement)

    assert (hides(0.99), hides(1.01), hides(1.01, ("pose_m",)), hides(1.01, ())) == (False, True, False, False)


def test_point_scatter_beyond_stated_noise_is_implausible(clean_solution):
    """A scatter of points by 1.5 sigmas and more may hide outliers, though whole views do not scatter."""
    judgement = make_consensus(clean_solution).judgement
    for sigmas, hides in ((1.49, False), (1.51, True)):
        scale = replace(judgement.point_scale, variance=sigmas**2)
        assert may_hide_outliers(clean_solution, replace(judgement, point_scale=scale)) == hides
        assert is_convincing(make_consensus(clean_solution, variance=sigmas**2)) != hides


SIGMA = np.full(6, 1e-4)


def agreeing_of_misfits(misfits):
    """The agreeing samples if samples are off by these misfits in sigmas, at the true state."""
    known = Unknown("prior", SE3.identity(), np.full(6, 1e-9))
    problem, state = pose_problem(np.outer(misfits, SIGMA), SIGMA, known)
    return agreeing_samples(problem, [state])


@pytest.mark.parametrize(("count", "found"), [(5, False), (6, True), (10, True), (16, True), (17, False)])
def test_agreeing_samples_are_three_to_eight_tenths(count, found):
    """Samples that agree are reported if they are 6 to 16 of twenty and separate from the rest.

    Fewer may be chance, more need no report.
    """
    misfits = np.where(np.arange(20) < count, 1.0, 50.0)
    assert agreeing_of_misfits(misfits) == (tuple(range(count)) if found else ())


@pytest.mark.parametrize(("gap", "found"), [(4.9, False), (5.1, True)])
def test_gap_to_the_rest_is_a_factor_of_five(gap, found):
    """Without a gap of a factor of five no samples are reported."""
    misfits = np.where(np.arange(20) < 10, 2.0, 2.0 * gap)
    assert agreeing_of_misfits(misfits) == (tuple(range(10)) if found else ())


def test_no_gap_within_the_noise():
    """Misfits below one sigma count as one sigma."""
    assert agreeing_of_misfits(np.where(np.arange(20) < 10, 0.01, 4.9)) == ()
    assert agreeing_of_misfits(np.where(np.arange(20) < 10, 0.01, 5.1)) == tuple(range(10))


def test_state_with_the_best_agreement_is_used():
    """The state whose agreeing samples fit better is used if two states have a gap. Without a state there are none."""
    known = Unknown("prior", SE3.identity(), np.full(6, 1e-9))
    problem, state = pose_problem(np.outer(np.where(np.arange(20) < 10, 2.0, 50.0), SIGMA), SIGMA, known)
    other = {**state.transforms, MOUNT: SE3.exp(-1.001 * 50 * SIGMA)}
    shifted = type(state)(other, {}, state.stop_errors)
    assert agreeing_samples(problem, [shifted]) == tuple(range(10, 20))
    assert agreeing_samples(problem, [state, shifted]) == tuple(range(10, 20))
    assert agreeing_samples(problem, []) == ()


def test_samples_are_split_at_the_first_clear_gap():
    """The result is the largest misfit before the gap, and the sorted sample numbers."""
    numbers = np.array([7, 3, 9, 1, 5, 8, 2, 4, 6, 0])
    sigmas = np.array([2.0, 1.5, 60.0, 1.7, 3.0, 70.0, 20.0, 4e18, 1.2, np.inf])
    assert _split_at_gap(numbers, sigmas) == (3.0, (1, 3, 5, 6, 7))
    assert _split_at_gap(numbers, np.where(sigmas < 10, 0.1, 5.1)) == (1.0, (1, 3, 5, 6, 7))
    assert _split_at_gap(numbers, np.where(sigmas < 10, 1e15, 1e30)) == (np.inf, ())


def test_gap_needs_samples_on_both_sides():
    """Without a gap, no samples are reported. One of two samples before a gap is."""
    assert _split_at_gap(np.arange(4), np.ones(4)) == (np.inf, ())
    assert _split_at_gap(np.arange(2), np.array([1.0, 100.0])) == (1.0, (0,))
    assert _split_at_gap(np.array([5, 2, 9]), np.array([100.0, 2.0, 1.0])) == (2.0, (2, 9))
