"""Views to second order say what the views say."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.noise.compressed_views import compressed
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.measurement import Noise
from basecal.simulation import Scenario, simulate

KINDS = {
    "pixels": Scenario(samples=6, state_pixel_noise=False),
    "pixels, lens free": Scenario(samples=6, intrinsics="free"),
    "poses": Scenario(samples=6, target="pose", state_observation_noise=False),
    "3-D points": Scenario(samples=6, target="points3d"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_second_order_is_exact_where_it_was_taken_and_near_beside(kind):
    """Cost, gradient and information agree to 1e-9 at the state for any sigmas, and the cost to 1 % a sigma away."""
    s = simulate(KINDS[kind], seed=1)
    problem, _ = build_problem(s.cell, s.recording)
    state = State(s.truth, s.cameras if problem.lenses else {}, np.zeros((0, 6)))
    noise = Noise(0.3, 2e-3, 4e-3, 1.5e-3)
    small, whole = compressed(problem, state).with_noise(noise), problem.with_noise(noise)
    ours, theirs = linearise(small, state), linearise(whole, state)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-9)
    np.testing.assert_allclose(ours.gradient, theirs.gradient, rtol=1e-6, atol=1e-9 * np.abs(theirs.gradient).max())
    np.testing.assert_allclose(ours.hessian, theirs.hessian, rtol=1e-6, atol=1e-9 * np.abs(theirs.hessian).max())
    sigma = np.sqrt(np.diag(np.linalg.inv(theirs.hessian)))
    beside = retract(problem, state, theirs, sigma * np.random.default_rng(0).standard_normal(problem.width))
    change = linearise(whole, beside).cost - theirs.cost
    assert linearise(small, beside).cost - ours.cost == pytest.approx(change, rel=0.01)
