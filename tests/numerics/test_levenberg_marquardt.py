"""Levenberg-Marquardt on curve fits whose optima are known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.numerics.levenberg_marquardt import Stop, levenberg_marquardt


@dataclass(frozen=True, eq=False)
class About:
    """Curves to second order."""

    cost: Array
    gradient: Array
    hessian: Array


@dataclass(frozen=True, eq=False)
class Exponentials:
    """Curves a exp(-b t), each seen at the same times."""

    seen: Array
    singular_above: float = np.inf
    times = np.linspace(0, 3, 20)

    def linearise(self, state):
        a, b = state[:, :1], state[:, 1:]
        if np.any(np.abs(b) > self.singular_above):
            raise np.linalg.LinAlgError
        with np.errstate(over="ignore"):
            curve = a * np.exp(-b * self.times)
        jacobian = np.stack([np.exp(-b * self.times), -self.times * curve], 1)
        residual = curve - self.seen
        gradient = (jacobian @ residual[..., None])[..., 0]
        return About(np.sum(residual**2, -1), gradient, jacobian @ np.swapaxes(jacobian, -1, -2))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return replace(self, seen=self.seen[rows])


TRUE = np.array([[1.0, 0.5], [2.0, 2.0], [-3.0, 0.1], [0.5, 5.0]])


def curves(noise: float = 0.0) -> Exponentials:
    exact = TRUE[:, :1] * np.exp(-TRUE[:, 1:] * Exponentials.times)
    return Exponentials(exact + noise * np.random.default_rng(0).standard_normal(exact.shape))


def test_every_problem_of_a_batch_finds_its_own_optimum():
    """Exact curves from one rough start: each ends at its own parameters to 1e-9."""
    optima = levenberg_marquardt(curves(), np.tile([1.0, 1.0], (4, 1)), Stop(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)
    assert len(set(optima.iterations)) > 1


@pytest.mark.parametrize("row", range(4))
def test_a_batch_is_each_problem_by_itself(row):
    """Noisy curves: a problem takes the same steps to the same end alone and among others."""
    start = np.tile([1.0, 1.0], (4, 1))
    together = levenberg_marquardt(curves(0.1), start, Stop(dof=18))
    alone = levenberg_marquardt(curves(0.1).take([row]), start[[row]], Stop(dof=18))
    np.testing.assert_allclose(together.state[row], alone.state[0], atol=1e-12)
    assert together.iterations[row] == alone.iterations[0]


def test_no_step_goes_uphill():
    """Stopped after any number of steps, no cost is above that of fewer steps."""
    start = np.tile([1.0, 1.0], (4, 1))
    costs = [levenberg_marquardt(curves(0.1), start, Stop(iterations=k)).cost for k in range(1, 40)]
    assert np.all(np.diff(costs, axis=0) <= 1e-12)
    assert np.all(costs[-1] < 0.5 * curves(0.1).linearise(start).cost)


def test_the_end_is_where_the_gradient_vanishes():
    """At the ends the gradient is zero to 1e-4 sigmas."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Stop(dof=18))
    about = curves(0.1).linearise(optima.state)
    left = np.einsum("bi,bi->b", about.gradient, np.linalg.solve(about.hessian, about.gradient[..., None])[..., 0])
    assert np.all(left <= 1e-8 * about.cost / 18)


def test_a_state_beyond_numbers_is_a_step_refused():
    """Where a problem cannot be linearised its step is refused, and the others of the batch go on."""
    system = replace(curves(), singular_above=5.5)
    optima = levenberg_marquardt(system, np.tile([1.0, 1.0], (4, 1)), Stop(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)


def test_not_converged_is_said():
    """Two steps from a rough start are not enough, and that is what the result says."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Stop(iterations=2))
    assert not optima.converged.any()
    assert np.all(optima.iterations == 2)


def test_looser_ends_come_sooner_and_stay_within_what_is_allowed():
    """A tenth of a sigma takes fewer steps than the default, and ends within two tenths of its optimum."""
    start = np.tile([1.0, 1.0], (4, 1))
    tight = levenberg_marquardt(curves(0.1), start, Stop(dof=18))
    loose = levenberg_marquardt(curves(0.1), start, Stop(dof=18, sigmas=0.1))
    assert loose.converged.all()
    assert loose.iterations.sum() < tight.iterations.sum()
    off, hessian = loose.state - tight.state, curves(0.1).linearise(tight.state).hessian
    assert np.all(np.einsum("bi,bij,bj->b", off, hessian, off) <= 0.2**2 * tight.cost / 18)
    assert np.any(np.abs(off) > 1e-9)
