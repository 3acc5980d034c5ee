"""Tests of sigmas estimated from residuals, with the freedoms that unknowns take."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.cell import Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise import estimate as module
from basecal.estimation.noise.estimate import NoiseEstimate, degrees_of_freedom, estimate_noise, residual_counts
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def estimate_pose_noise(errors, sigma=None, prior=None):
    """The estimated noise, and the mount, of poses with these errors."""
    problem, state = pose_problem(errors, sigma, prior)
    end = bundle_adjust(problem, state, 1, 30)
    problem, end, noise = estimate_noise(problem, end, 30)
    return problem, end, noise


def test_residuals_and_freedoms_are_counted():
    """A pose has three residuals for each of its two sigmas. A prior adds six residuals, the mount takes six away."""
    errors = np.zeros((5, 6))
    assert residual_counts(pose_problem(errors, None)[0]) == {"stated": 0, "pose_m": 15, "pose_rad": 15}
    assert residual_counts(pose_problem(errors, np.ones(6))[0]) == {"stated": 30, "pose_m": 0, "pose_rad": 0}
    prior = Unknown("prior", SE3.identity(), np.ones(6))
    assert degrees_of_freedom(pose_problem(errors, None)[0]) == 24
    assert degrees_of_freedom(pose_problem(errors, None, prior)[0]) == 30


def test_stated_sigmas_are_kept(rng):
    """With all sigmas stated, no sigma is estimated or scaled, however large the residuals are."""
    errors = 1e-3 * rng.normal(size=(40, 6))
    _, _, noise = estimate_pose_noise(errors, np.full(6, 1e-3))
    assert noise.estimated == ()
    assert noise.factor == 1.0
    _, _, noise = estimate_pose_noise(errors, np.full(6, 1e-4))
    assert noise.factor == 1.0


def test_unstated_sigmas_equal_those_of_residuals(rng):
    """With a free mount, each sigma is that of the residuals with three freedoms fewer."""
    errors = rng.normal(size=(20, 6)) * np.repeat([2e-3, 5e-4], 3)
    _, _, noise = estimate_pose_noise(errors)
    off = errors - errors.mean(0)
    for part, sigma in ((slice(0, 3), noise.noise.pose_m), (slice(3, 6), noise.noise.pose_rad)):
        assert sigma == pytest.approx(np.sqrt(np.sum(off[:, part] ** 2) / 57), rel=2e-3)
    assert noise.converged
    assert noise.estimated == ("pose_m", "pose_rad")


def test_sigmas_of_poses_and_points_are_separate(rng):
    """Beside points a thousand times as exact, which determine the mount, poses lose no freedoms."""
    errors = rng.normal(size=(20, 6)) * np.repeat([2e-3, 5e-4], 3)
    problem, state = pose_problem(errors, None)
    (group,) = problem.groups
    corners, seen = np.eye(3), np.ones((20, 3), dtype=bool)
    points = PointMeasurement(corners, corners + 1e-6 * rng.normal(size=(20, 3, 3)), seen, 0.0 * seen, 1.0 * seen)
    both = problem.with_groups([group, replace(group, measurement=points)])
    _, _, noise = estimate_noise(both, bundle_adjust(both, state, 1, 30), 30)
    assert (noise.converged, noise.estimated) == (True, ("pose_m", "pose_rad", "point_m"))
    assert noise.noise.pose_m == pytest.approx(np.sqrt(np.mean(errors[:, :3] ** 2)), rel=2e-3)
    assert noise.noise.pose_rad == pytest.approx(np.sqrt(np.mean(errors[:, 3:] ** 2)), rel=2e-3)


def test_prior_reduces_the_freedoms_of_unknowns(rng):
    """With a prior of sigma s, unknowns take 3 n s^2 / (n s^2 + sigma^2) freedoms: MacKay's gamma."""
    n, width = 8, 1e-3
    errors = 2e-3 * rng.normal(size=(n, 6))
    prior = Unknown("prior", SE3.identity(), np.full(6, width))
    problem, end, noise = estimate_pose_noise(errors, None, prior)
    squares = problem.groups[0].measurement.squares(
        end.state.camera_from_target(problem.groups[0], problem.stops), None
    )
    for name in ("pose_m", "pose_rad"):
        variance = getattr(noise.noise, name) ** 2
        paid = 3 * n * width**2 / (n * width**2 + variance)
        assert 1.5 < paid < 2.9
        assert squares[name] == pytest.approx(3 * n - paid, rel=2e-3)


def test_unstated_poses_lose_their_share_of_freedoms(rng):
    """Three poses state 1 mm and mrad and six state none. The six lose freedoms only for their share of the mount."""
    n, stated = 9, np.arange(9) < 3
    errors = 2e-3 * rng.normal(size=(n, 6))
    problem, state = pose_problem(errors, np.full(6, 1e-3))
    (group,) = problem.groups
    inverse = np.where(stated[:, None], group.measurement.stated, 0.0)
    silent = replace(group.measurement, stated=inverse, weight=np.where(inverse > 0, inverse, 1.0))
    problem = problem.with_groups([replace(group, measurement=silent)])
    end = bundle_adjust(problem, state, 1, 30)
    problem, end, noise = estimate_noise(problem, end, 30)
    assert (noise.converged, noise.factor, noise.estimated) == (True, 1.0, ("pose_m", "pose_rad"))
    for name, part in (("pose_m", slice(0, 3)), ("pose_rad", slice(3, 6))):
        variance = getattr(noise.noise, name) ** 2
        weights = np.where(stated, 1e6, 1 / variance)
        off = errors[:, part] - weights @ errors[:, part] / weights.sum()
        paid = 3 * (6 / variance) / weights.sum()
        assert 0.3 < paid < 2.5
        assert np.sum(off[~stated] ** 2) / variance == pytest.approx(18 - paid, rel=3e-3)


def test_single_unstated_sigma_is_a_factor(rng):
    """The factor is cost over freedoms, for points in pixels without other stated noise.

    Held noise is no longer estimated.
    """
    made = simulate(Scenario(samples=6, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    end = bundle_adjust(problem, State(made.truth, made.cameras, np.zeros((0, 6))), 1, 30)
    same, again, noise = estimate_noise(problem, end, 30)
    count = 2 * sum(int(g.measurement.seen.sum()) for g in problem.groups)
    assert degrees_of_freedom(problem) == count - 18
    assert noise.factor == pytest.approx(end.cost / (count - 18))
    assert noise.noise.pixel_px == pytest.approx(Noise().pixel_px * np.sqrt(noise.factor))
    assert 0.15 < noise.noise.pixel_px < 0.25
    assert (same is problem, again is end, noise.estimated) == (True, True, ("pixel_px",))
    held = replace(problem, held=True)
    _, _, noise = estimate_noise(held, end, 30)
    assert (noise.factor, noise.estimated, noise.noise) == (1.0, (), Noise())
    fixed = {
        name: replace(u, status="prior", mean=made.truth[name], sigma=np.ones(6))
        for name, u in problem.unknowns.items()
    }
    _, _, noise = estimate_noise(replace(problem, unknowns=fixed), end, 30)
    assert noise.factor == 1.0
    assert noise.noise.pixel_px == pytest.approx(np.sqrt(end.cost / (count - 18)) * Noise().pixel_px, rel=1e-3)


@pytest.mark.parametrize(("links", "more"), [("free", 0), ("prior", 1)])
def test_arm_priors_add_residuals_for_their_columns(links, more):
    """With six offsets and all observable links, a prior adds what its columns take away. The same holds for a lens."""
    scenario = Scenario(samples=12, target="points", joints=True, joint_offset_rad=1e-3, joint_offsets="prior",
                        link_error=(1e-3, 1e-3), link_parameters=links, intrinsics="prior")  # fmt: skip
    made = simulate(scenario, 0)
    problem, _ = build_problem(made.cell, made.recording)
    count = sum(residual_counts(problem).values())
    free = sum(m.widths[f"{name}_link_parameters"] for name, m in problem.models.items())
    assert free > 12
    assert degrees_of_freedom(problem) == count - 18 - (0 if more else free)


def variance_ratio(problem, state, noise, name="pose_m"):
    """New over old variance of one field at a state."""
    problem = problem.with_noise(noise)
    return module._variance_ratio(
        problem, SimpleNamespace(state=state, normal=linearise(problem, state)), noise, name, 3 * len(problem.groups[0])
    )


@pytest.mark.parametrize(("stop", "sigma"), [(1e-3, 2e-3), (3e-3, 1e-3)])
def test_views_at_own_stops_lose_freedoms_to_them(rng, stop, sigma):
    """With n own stops of sigma s, each coordinate loses (s^2 n + sigma^2) / (s^2 + sigma^2) freedoms."""
    errors = 1e-3 * rng.standard_normal((5, 6))
    problem, state = pose_problem(errors, None, stop_sigma=np.full(6, stop))
    squares = np.sum(errors[:, :3] ** 2) / sigma**2
    paid = 3 * (5 * stop**2 + sigma**2) / (stop**2 + sigma**2)
    found = variance_ratio(problem, state, Noise(pose_m=sigma))
    assert found == pytest.approx(squares / (15 - paid), rel=1e-3)


def test_view_without_freedoms_keeps_a_hundredth():
    """The variance is then 100 times its mean square, limited to a change by 1e-8 to 1e8."""
    for size, expected in ((1e-3, 100.0), (1e-9, 1e-8), (3.0, 1e8)):
        problem, state = pose_problem(np.array([[size, -size, size, 0.0, 0.0, 0.0]]), None)
        assert variance_ratio(problem, state, Noise()) == pytest.approx(expected, rel=1e-4)


def test_exact_fit_has_a_sigma_of_a_nanometre():
    """The smallest sigmas are 1 nm and 1 nrad, because less is rounding."""
    _, _, noise = estimate_pose_noise(np.zeros((4, 6)))
    assert noise.noise.pose_m == pytest.approx(1e-9, rel=1e-3)
    assert noise.noise.pose_rad == pytest.approx(1e-9, rel=1e-3)
    assert noise.converged


def test_missing_convergence_of_the_estimate_is_reported(rng, monkeypatch):
    """After one round of an estimate that needs several, it is not converged."""
    monkeypatch.setattr(module, "_FIXED_POINT_ROUNDS", 1)
    _, _, noise = estimate_pose_noise(0.1 * rng.standard_normal((4, 6)))
    assert (noise.converged, noise.factor, noise.estimated) == (False, 1.0, ("pose_m", "pose_rad"))


def test_factor_with_fewest_freedoms():
    """With as many numbers as unknowns the factor is the cost. A cost that is negative by rounding gives zero."""
    made = simulate(
        Scenario(samples=9, target="led", camera_mount="fixed", target_mount="fixed", state_pixel_noise=False), 0
    )
    problem, _ = build_problem(made.cell, made.recording)
    end = bundle_adjust(problem, State(made.truth, made.cameras, np.zeros((0, 6))), 1, 2)
    for views, freedoms in ((3, 1), (4, 2), (9, 12)):
        few = problem.with_groups(g.take(np.arange(views)) for g in problem.groups)
        assert max(degrees_of_freedom(few), 1) == freedoms
        for cost, factor in ((5.0, 5.0 / freedoms), (-1e-9, 0.0)):
            _, _, noise = estimate_noise(few, replace(end, cost=cost), 2)
            assert noise.factor == pytest.approx(factor)
            assert (noise.converged, noise.estimated) == (True, ("pixel_px",))


def test_held_or_stated_noise_needs_no_estimate(rng):
    """The noise is converged without an estimate."""
    problem, state = pose_problem(1e-3 * rng.standard_normal((4, 6)), np.full(6, 1e-3))
    end = bundle_adjust(problem, state, 1, 2)
    for given in (problem, replace(problem, held=True)):
        same, again, noise = estimate_noise(given, end, 2)
        assert (same is given, again is end, noise.converged, noise.factor) == (True, True, True, 1.0)
        assert (noise.minus_2_log_evidence, noise.plain_minus_2_log_evidence) == (0.0, 0.0)


def test_hold_sigmas_applies_the_estimate():
    """Each camera has its own noise or that of all. Robots and jitter are added to those of the problem."""
    problem, _ = pose_problem(np.zeros((2, 6)), None)
    (group,) = problem.groups
    two = replace(problem.with_groups([group, replace(group, camera="other")]), jitter_s={"other": 1e-3})
    noise = NoiseEstimate(
        Noise(pose_m=2e-3), 1.0, ("pose_m",), True, robots={"eye": np.full(6, 1e-4)},
        cameras={"other": Noise(pose_m=5e-3)}, jitter_s={"camera": 2e-3},
    )  # fmt: skip
    held = noise.hold_sigmas(two)
    assert held.held
    assert [g.measurement.weight[0, 0] for g in held.groups] == pytest.approx([500.0, 200.0])
    assert (held.jitter_s, held.stops.robot) == ({"other": 1e-3, "camera": 2e-3}, ("eye", "eye"))
    np.testing.assert_array_equal(held.stops.sigma, 1e-4)
