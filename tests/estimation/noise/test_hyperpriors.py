"""What is known of sigmas beforehand."""

from __future__ import annotations

import numpy as np

from basecal.estimation.noise.hyperpriors import hyperpriors
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.simulation import Scenario, simulate


def test_two_robots_are_expected_alike_and_slopes_are_derivatives():
    """Beforehand both arms have 0.3 mrad, and reach times that; the slope agrees with central differences."""
    s = simulate(Scenario(samples=8, state_robot_noise=False, state_pixel_noise=False), 1)
    problem, _ = build_problem(s.cell, s.recording)
    unit = with_robot_noise(problem, dict.fromkeys(("eye", "hand"), np.ones(6)))
    model = mixed_model(unit, without_errors(unit, State(s.truth, s.cameras, np.zeros((0, 6)))), ("eye", "hand"))
    prior = hyperpriors(model, {"eye": 0.5, "hand": 0.8})
    np.testing.assert_allclose(np.exp(prior.start[1:]), [1.5e-4, 3e-4, 2.4e-4, 3e-4], rtol=1e-9)
    logs = prior.start + np.linspace(-1, 1, 5)
    steps = 1e-5 * np.eye(5)
    slope = [(prior.value(logs + h)[0] - prior.value(logs - h)[0]) / 2e-5 for h in steps]
    np.testing.assert_allclose(prior.value(logs)[1], slope, rtol=1e-6)
