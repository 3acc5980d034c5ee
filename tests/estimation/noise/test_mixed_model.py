"""A problem about a state as a mixed model leads to the optimum of the problem itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests.estimation.noise.test_reml import NOISY, ROBOTS, at_truth

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.reml import posterior
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors


def test_step_leads_to_the_optimum():
    """At the optimum of the same sigmas the most likely unknowns are no step away, and errors of stops as they are."""
    problem, state = at_truth(NOISY)
    sigma = np.repeat([1e-3, 2e-3], 3)
    used = with_robot_noise(problem, dict.fromkeys(ROBOTS, sigma))
    end = bundle_adjust(used, without_errors(used, state), 100)
    physical = replace(end.state, stop_errors=end.state.stop_errors * used.stops.sigma)
    known = posterior(mixed_model(problem, physical, ROBOTS), np.log([1e-3, 2e-3] * 2))
    assert np.abs(known.step).max() < 1e-6
    np.testing.assert_allclose(known.stop_errors, physical.stop_errors, atol=1e-6)
    np.testing.assert_allclose(known.covariance, np.linalg.inv(end.normal.hessian), rtol=1e-3, atol=1e-11)
