"""Tests of views that a scene's points connect, linearised at a state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.least_squares.bundle_adjustment import batch_states
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.least_squares.tied_equations import linearise_scene
from basecal.geometry import SE3
from tied_scene import tracks_alone


def test_scene_derivatives_equal_finite_differences() -> None:
    """The slope of the cost along unknowns and stop errors equals the gradient, also far from the reference."""
    _, _, problem, state = tracks_alone(1, count=4)
    assert problem.tied is not None
    rng = np.random.default_rng(0)
    shifted = {name: at @ SE3.exp(np.full(6, 0.02)) for name, at in state.transforms.items()}
    state = replace(state, transforms=shifted, stop_errors=rng.standard_normal(state.stop_errors.shape))
    about, normal = linearise_scene(problem, problem.tied, state), linearise(problem, state)
    step = 1e-7 * rng.standard_normal(problem.width)
    errors = 1e-7 * rng.standard_normal(state.stop_errors.shape)

    def cost(sign: float) -> float:
        """The cost after a step forwards or backwards."""
        moved = retract(problem, state, normal, sign * step)
        moved = replace(moved, stop_errors=state.stop_errors + sign * errors)
        return float(linearise_scene(problem, problem.tied, moved).cost)

    slope = about.gradient @ (about.by_unknowns @ step + about.by_errors @ errors.ravel())
    np.testing.assert_allclose((cost(1) - cost(-1)) / 4, slope, rtol=1e-5)


def test_scene_batch_equals_separate_states() -> None:
    """Costs and Hessians of two states in a batch are those of each."""
    _, _, problem, state = tracks_alone(1, count=4)
    moved = replace(state, transforms={name: at @ SE3.exp(np.full(6, 1e-3)) for name, at in state.transforms.items()})
    alone = [linearise(problem, each) for each in (state, moved)]
    both = linearise(problem, batch_states(problem, [state, moved]))
    np.testing.assert_allclose(both.cost, [each.cost for each in alone], rtol=1e-9)
    scale = np.abs(alone[0].hessian).max()
    np.testing.assert_allclose(both.hessian / scale, np.stack([each.hessian for each in alone]) / scale, atol=1e-9)
