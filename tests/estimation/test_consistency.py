"""Tests of consistency: errors of the base agree with the covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.consistency_trial import ESTIMATED, FREEDOMS, SCENARIOS, band, base_error

from basecal.estimation.settings import RobotNoise
from basecal.estimation.solve import solve
from basecal.geometry import Camera
from basecal.simulation import Scenario, simulate
from quick import quick

# A mean over n cells has 6 n degrees of freedom. The band is left by chance once in a million times: a failure is a
# defect. Fifty cells show a covariance that is wrong by four tenths, 400 one by a seventh, and 2,000, by the narrower
# band of `benchmarks.consistency`, one by a twentieth.
CHANCE = 1e-6
QUICK = ("board, mounts free, halves, robot noise", "light, mounts free, robot noise")
CORRELATED = Scenario(samples=20, correlated_px=0.3)


def mean_nees(scenario: Scenario, cells: int, robot_noise: RobotNoise | None = None) -> float:
    """Mean of NEES / 6; all cells have to converge."""
    errors = [base_error(scenario, seed, robot_noise) for seed in range(10_000, 10_000 + cells)]
    assert all(error.converged for error in errors)
    return float(np.mean([error.nees for error in errors])) / FREEDOMS


@pytest.mark.journey
@pytest.mark.parametrize("name", quick(QUICK, QUICK[:1]))
def test_base_covariance_is_consistent(name: str) -> None:
    """Over 50 cells the mean of xi' C^-1 xi / 6 of the base is 1, within the band of 300 degrees of freedom.

    So is the mean whitened by the Cramer-Rao bound at the truth instead of the covariance: no estimate could do better.
    """
    low, high = band(50, CHANCE)
    errors = [base_error(SCENARIOS[name], seed) for seed in range(10_000, 10_050)]
    assert all(error.converged for error in errors)
    assert low <= np.mean([e.nees for e in errors]) / FREEDOMS <= high
    assert low <= np.mean([e.nees_by_bound for e in errors]) / FREEDOMS <= high


@pytest.mark.journey
def test_unstated_robot_noise_is_detected() -> None:
    """The band is sensitive to robot noise that is neither stated nor estimated.

    The errors are then larger than the covariance, and with an estimate, the same cells are within it.
    """
    stated = SCENARIOS["board, eye still, mounts fixed, robot noise"]
    silent = replace(stated, state_robot_noise=False)
    assert mean_nees(silent, 6, "stated") > band(6, CHANCE)[1]
    assert mean_nees(silent, 6, "estimated") < band(6, CHANCE)[1]


@pytest.mark.journey
def test_covariance_includes_a_shared_error_of_a_view() -> None:
    """With a stated error that all points of a view share, it is consistent, too: 36 corners are not independent."""
    low, high = band(40, CHANCE)
    assert low <= mean_nees(CORRELATED, 40) <= high


@pytest.mark.journey
def test_tilt_of_the_mount_is_unbiased_for_real_lenses() -> None:
    """Twelve views are by a free lens that is as far off its axis as some real ones.

    In sigmas a mean over ten cells scatters by 0.32; if these terms were assumed a third as large, it would be -1.8.
    """
    lens = Camera("pinhole", np.array([935.0, 934.0, 646.0, 348.0, -0.09, 0.026, 4e-3, -2e-3, 0.3]), (1280, 720))
    noise = {"pixel_px": 0.3, "robot_noise": (3e-4, 5e-4)}
    scenario = Scenario(12, layout="eye_in_hand", intrinsics="free", camera=lens, spread_rad=0.4, **noise)
    tilts = []
    for seed in range(10):
        made = simulate(scenario, seed)
        mount = solve(made.cell, made.recording).transforms["arm_flange_from_wrist"]
        tilts.append((mount.mean.inverse() @ made.truth["arm_flange_from_wrist"]).log()[3] / mount.sigma_r[0])
    assert abs(np.mean(tilts)) < 1.0


@pytest.mark.slow
def test_one_estimated_factor_inflates_like_f() -> None:
    """Ten degrees of freedom make the mean 10 / 8: 600 cells scatter by a twentieth of it (a mean of F(6, 10))."""
    errors = [base_error(ESTIMATED["light, mounts fixed, 8 samples, pixel sigma"], seed) for seed in range(600)]
    mean = np.mean([e.nees for e in errors]) / FREEDOMS
    assert {e.inflation for e in errors} == {10 / 8}
    # F(6, 10) has the standard deviation 0.95; 0.95 / sqrt(600) = 0.039, and its tail is heavy: five of them.
    assert mean == pytest.approx(1.25, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_covariance_is_consistent(name: str) -> None:
    """Over 400 cells of every scenario, the mean is within the band of 2,400 degrees of freedom."""
    low, high = band(400, CHANCE)
    assert low <= mean_nees(SCENARIOS[name], 400) <= high
