"""Errors of the base are as large as the covariance says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.consistency import FREEDOMS, SCENARIOS, band, error_of

from basecal.simulation import Scenario

# A mean over n cells has 6 n degrees of freedom. The band is left by chance once in a million times: a failure is a
# fault. A hundred cells show a covariance that is wrong by a third, 400 one by a seventh, and 2,000, by the narrower
# band of `benchmarks.consistency`, one by a twentieth.
CHANCE = 1e-6
QUICK = (
    "board, mounts free",
    "board, eye still, mounts fixed, robot noise",
    "board, mounts free, halves, robot noise",
    "light, mounts free, robot noise",
)


def mean_of(scenario: Scenario, cells: int, first_seed: int = 10_000) -> float:
    """Mean of NEES / 6; NaN if any base was not seen."""
    errors = [error_of(scenario, seed) for seed in range(first_seed, first_seed + cells)]
    assert all(error.converged for error in errors)
    return float(np.mean([error.nees for error in errors])) / FREEDOMS


@pytest.mark.parametrize("name", QUICK)
def test_covariance_is_true(name: str) -> None:
    """Over 100 cells the mean of xi' C^-1 xi / 6 of the base is 1, within the band of 600 degrees of freedom."""
    low, high = band(100, CHANCE)
    assert low <= mean_of(SCENARIOS[name], 100) <= high


def test_robot_noise_that_is_not_told_is_noticed() -> None:
    """The band bites: with robots' noise left out of the cell, the errors are larger than the covariance says."""
    told = SCENARIOS["board, eye still, mounts fixed, robot noise"]
    assert mean_of(replace(told, state_robot_noise=False), 20) > band(20, CHANCE)[1]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_covariance_is_true(name: str) -> None:
    """Over 400 cells of every scenario likewise, within the band of 2,400 degrees of freedom."""
    low, high = band(400, CHANCE)
    assert low <= mean_of(SCENARIOS[name], 400) <= high
