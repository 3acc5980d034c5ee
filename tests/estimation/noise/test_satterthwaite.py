"""Degrees of freedom of covariances that rest on estimated sigmas."""

from __future__ import annotations

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.satterthwaite import components_of, freedoms_of
from basecal.estimation.view.measurement import Noise

SIGMA = np.repeat([2e-3, 1e-3], 3)


def arm_errors(n, rng):
    """Errors of n stops whose mean is zero and whose variances are those of `SIGMA`, by three freedoms less."""
    errors = rng.normal(size=(n, 6))
    errors -= errors.mean(0)
    for part in (slice(0, 3), slice(3, 6)):
        errors[:, part] *= np.sqrt((3 * n - 3) / np.sum(errors[:, part] ** 2))
    return errors * SIGMA


@pytest.mark.parametrize("n", [6, 20])
def test_robot_noise_has_the_freedoms_of_its_stops(rng, n):
    """A mount seen from n stops, exactly, is known with the 3 n - 3 freedoms that each sigma of the arm is."""
    problem, state = pose_problem(arm_errors(n, rng), np.full(6, 1e-7), stop_sigma=SIGMA)
    noise = NoiseEstimate(Noise(), 1.0, (), True, {"eye": SIGMA})
    assert freedoms_of(problem, state, noise, MOUNT) == pytest.approx(3 * n - 3, rel=0.05)


def test_one_factor_has_the_freedoms_of_all_residuals():
    """A common factor is known with n - p freedoms; stated sigmas have infinitely many."""
    problem, state = pose_problem(np.zeros((5, 6)), None)
    noise = NoiseEstimate(Noise(), 2.0, ("pose_m",), True)
    assert freedoms_of(problem, state, noise, MOUNT) == 24
    assert freedoms_of(problem, state, NoiseEstimate(Noise(), 1.5, (), True), MOUNT) == 24
    assert freedoms_of(problem, state, NoiseEstimate(Noise(), 1.0, (), True), MOUNT) == float("inf")


def test_components_are_the_sigmas_in_use():
    """Each pair of sigmas of robots is one component of two, after those of the views."""
    problem, state = pose_problem(np.zeros((6, 6)), np.full(6, 1e-4), stop_sigma=SIGMA)
    found = components_of(problem, state, NoiseEstimate(Noise(), 1.0, (), True, {"eye": SIGMA}))
    np.testing.assert_allclose(np.exp(found.logs), [2e-3, 1e-3])
    assert found.model.pools == (("eye",),)
