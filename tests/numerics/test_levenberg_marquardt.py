"""Tests of Levenberg-Marquardt on curve fits with known optima."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.numerics.levenberg_marquardt import (
    FIRST_DAMPING,
    Criteria,
    Quadratic,
    _accept_step,
    _Active,
    _damped_step,
    _has_converged,
    _is_gauss_newton,
    _is_near,
    _next_step,
    _scale,
    join_ends,
    levenberg_marquardt,
)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A cost to second order."""

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array | float = 0.0


@dataclass(frozen=True, eq=False)
class Exponentials:
    """Curves a exp(-b t), each sampled at the same times."""

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
        return Linearisation(np.sum(residual**2, -1), gradient, jacobian @ np.swapaxes(jacobian, -1, -2))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return replace(self, seen=self.seen[rows])


TRUE = np.array([[1.0, 0.5], [2.0, 2.0], [-3.0, 0.1], [0.5, 5.0]])


def curves(noise: float = 0.0) -> Exponentials:
    exact = TRUE[:, :1] * np.exp(-TRUE[:, 1:] * Exponentials.times)
    return Exponentials(exact + noise * np.random.default_rng(0).standard_normal(exact.shape))


def test_every_problem_of_a_batch_converges():
    """Exact curves from one rough start converge to their own parameters to 1e-9."""
    optima = levenberg_marquardt(curves(), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)
    assert len(set(optima.iterations)) > 1


@pytest.mark.parametrize("row", range(4))
def test_batch_equals_separate_problems(row):
    """A problem with noise takes the same steps to the same end alone and in a batch."""
    start = np.tile([1.0, 1.0], (4, 1))
    together = levenberg_marquardt(curves(0.1), start, Criteria(dof=18))
    alone = levenberg_marquardt(curves(0.1).take([row]), start[[row]], Criteria(dof=18))
    np.testing.assert_allclose(together.state[row], alone.state[0], atol=1e-12)
    assert together.iterations[row] == alone.iterations[0]


def test_cost_never_increases():
    """The cost after any number of steps is at most the cost after fewer steps."""
    start = np.tile([1.0, 1.0], (4, 1))
    costs = [levenberg_marquardt(curves(0.1), start, Criteria(iterations=k)).cost for k in range(1, 40)]
    assert np.all(np.diff(costs, axis=0) <= 1e-12)
    assert np.all(costs[-1] < 0.5 * curves(0.1).linearise(start).cost)


def test_gradient_vanishes_at_the_end():
    """The gradient at the final states is zero to 1e-4 sigmas."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(dof=18))
    about = curves(0.1).linearise(optima.state)
    left = np.einsum("bi,bi->b", about.gradient, np.linalg.solve(about.hessian, about.gradient[..., None])[..., 0])
    assert np.all(left <= 1e-8 * about.cost / 18)


def test_singular_linearisation_rejects_the_step():
    """If a problem cannot be linearised, its step is rejected and the others of the batch continue."""
    system = replace(curves(), singular_above=5.5)
    optima = levenberg_marquardt(system, np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)


def test_missing_convergence_is_reported():
    """Two steps from a rough start are not enough, and the result is not marked as converged."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=2))
    assert not optima.converged.any()
    assert np.all(optima.iterations == 2)


def test_looser_tolerance_takes_fewer_steps():
    """A tolerance of 0.1 sigma takes fewer steps than the default and ends within 0.2 sigma of the optimum."""
    start = np.tile([1.0, 1.0], (4, 1))
    tight = levenberg_marquardt(curves(0.1), start, Criteria(dof=18))
    loose = levenberg_marquardt(curves(0.1), start, Criteria(dof=18, tolerance=0.1))
    assert loose.converged.all()
    assert loose.iterations.sum() < tight.iterations.sum()
    off, hessian = loose.state - tight.state, curves(0.1).linearise(tight.state).hessian
    assert np.all(np.einsum("bi,bij,bj->b", off, hessian, off) <= 0.2**2 * tight.cost / 18)
    assert np.any(np.abs(off) > 1e-9)


def explicit_steps(system, row, x, steps):
    """The state of one problem after some steps, with Nielsen's damping of the diagonal."""
    one, damping, growth = system.take([row]), 1e-9, 2.0
    about = one.linearise(x[None])
    for _ in range(steps):
        hessian, gradient = about.hessian[0], about.gradient[0]
        step = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
        tried = one.linearise((x + step)[None])
        if tried.cost[0] <= about.cost[0]:
            gain = np.clip((about.cost[0] - tried.cost[0]) / (step @ hessian @ step), -10, 10)
            damping, growth = max(damping * max(0.1, 1 - (2 * gain - 1) ** 3), 1e-9), 2.0
            x, about = x + step, tried
        else:
            damping, growth = max(damping, 1e-3) * growth, 2 * growth
    return x


@pytest.mark.parametrize("first", [(1.0, 4.0), (0.1, -1.0), (1.0, -1.0)])
@pytest.mark.parametrize("steps", [1, 2, 3, 5, 6, 8])
def test_damping_follows_the_gain(steps, first):
    """Steps equal a reference with Nielsen's damping, for accepted and rejected steps, if none is near its end.

    Most problems have not ended by then.
    """
    start = np.tile(first, (4, 1))
    with np.errstate(all="ignore"):
        optima = levenberg_marquardt(curves(0.1), start, Criteria(iterations=steps, tolerance=1e-12, dof=1e12))
        wanted = [explicit_steps(curves(0.1), row, start[row], steps) for row in range(4)]
    going = optima.iterations == steps
    np.testing.assert_allclose(optima.state[going], np.array(wanted)[going], rtol=1e-7)
    assert np.count_nonzero(going) >= (4 if steps < 5 else 1)


@dataclass(frozen=True, eq=False)
class WrongGradient:
    """A slope with a gradient of the wrong sign, so that no step reduces the cost."""

    slope: float = 1.0

    def linearise(self, state):
        return Linearisation(10.0 + state[:, 0], np.full((len(state), 1), -self.slope), np.ones((len(state), 1, 1)))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return self


@dataclass(frozen=True, eq=False)
class CurvedResiduals:
    """Residuals x + 1 and c x^2 + x - 1 for each c, where Gauss-Newton steps about the optimum 0 go by 1 + c."""

    c: Array

    def linearise(self, state):
        x = state[:, 0]
        residual = np.stack([x + 1, self.c * x**2 + x - 1], -1)
        jacobian = np.stack([np.ones_like(x), 2 * self.c * x + 1], -1)
        gradient = np.einsum("bi,bi->b", jacobian, residual)[:, None]
        return Linearisation(np.sum(residual**2, -1), gradient, np.sum(jacobian**2, -1)[:, None, None])

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return replace(self, c=self.c[rows])


def test_convergence_with_second_order_curvature():
    """Ten steps reach the optimum to 1e-5 sigma if steps overshoot it by up to 0.9 of their length or fall short."""
    system = CurvedResiduals(np.array([-0.9, -0.5, 0.0, 0.4, 0.7]))
    optima = levenberg_marquardt(system, np.full((5, 1), 0.01), Criteria(iterations=10))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state[:, 0], 0.0, atol=1.5e-5)


@pytest.mark.parametrize("c", [-3.0, -30.0])
def test_damped_steps_learn_strong_curvature(c):
    """At most 15 steps suffice if Gauss-Newton steps are 4 or 30 times too long. Damping alone took 18 and 44."""
    optimum = levenberg_marquardt(CurvedResiduals(np.array([c])), np.full((1, 1), 0.01), Criteria(iterations=100))
    assert optimum.converged[0]
    assert optimum.iterations[0] <= 15
    np.testing.assert_allclose(optimum.state[:, 0], 0.0, atol=1.5e-5)


@dataclass(frozen=True, eq=False)
class EliminatedUnknown:
    """(x - y)^2 + (y - 1)^2 / 100 of x and of the eliminated y, which moves only half of its way at each step."""

    def linearise(self, state):
        x, y = state.T
        force = y - x + (y - 1) / 100
        gradient = (x - y) + force / 1.01
        cost = (x - y) ** 2 + (y - 1) ** 2 / 100
        return Linearisation(cost, gradient[:, None], np.full((len(x), 1, 1), 1 - 1 / 1.01), force**2 / 1.01)

    def retract(self, state, about, step):
        x, y = state.T
        best = (x + step[:, 0] + 0.01) / 1.01
        return np.stack([x + step[:, 0], (y + best) / 2], -1)

    def take(self, rows):
        return self


def test_no_convergence_while_eliminated_unknowns_move():
    """From the best x and a distant y, both unknowns are found to within the tolerance."""
    optima = levenberg_marquardt(
        EliminatedUnknown(), np.array([[1.0, 5.0], [-3.0, 1.0]]), Criteria(dof=1e4, tolerance=1e-6)
    )
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, 1.0, atol=1e-3)


@pytest.mark.parametrize(("slope", "converged", "steps"), [(1.0, True, 8), (1e12, False, 10)])
def test_useless_steps_are_damped_until_the_end(slope, converged, steps):
    """With a wrong gradient every step is damped more.

    A step that is negligible for the data ends converged, one beyond all damping is given up.
    """
    optima = levenberg_marquardt(WrongGradient(slope), np.array([[3.0], [5.0]]), Criteria(iterations=50))
    np.testing.assert_array_equal(optima.state, [[3.0], [5.0]])
    np.testing.assert_array_equal(optima.cost, [13.0, 15.0])
    assert optima.converged.tolist() == [converged] * 2
    assert optima.iterations.tolist() == [steps] * 2


def test_unobservable_direction_is_no_error():
    """An unknown without effect keeps its value, and the other one reaches its optimum."""

    @dataclass(frozen=True, eq=False)
    class Half(WrongGradient):
        """A parabola of the first of two unknowns."""

        def linearise(self, state):
            gradient = np.stack([state[:, 0] - 2.0, np.zeros(len(state))], 1)
            return Linearisation((state[:, 0] - 2.0) ** 2, gradient, np.tile(np.diag([1.0, 0.0]), (len(state), 1, 1)))

    optima = levenberg_marquardt(Half(), np.array([[0.0, 7.0]]), Criteria())
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, [[2.0, 7.0]], atol=1e-6)


def make_active(
    cost=8.0, dof=2.0, damping=1e-9, growth=2.0, expected=0.0, eliminated=0.0, hessian=None, gradient=(0, 0)
):
    """The state of one problem of two unknowns during a descent."""
    hessian = np.eye(2) if hessian is None else np.array(hessian, dtype=float)
    about = Quadratic(np.array([cost]), np.array([gradient], dtype=float), hessian[None], np.array([eliminated]))
    numbers = (np.array([float(of)]) for of in (dof, damping, growth, expected))
    return _Active(np.array([0]), np.zeros((1, 2)), np.array([cost]), about, *numbers, np.zeros((1, 2, 2)))


LOOSE = Criteria(tolerance=1e-2)  # with a scale of 4, at most 4e-4 may remain


@pytest.mark.parametrize(("expected", "before", "damping", "settled"), [
    (3.9e-4, 0.0, 1e-9, True),
    (4.1e-4, 0.0, 1e-9, False),
    (4.1e-4, 8e-4, 1e-9, True),  # half of the previous decrease: the same amount remains in total
    (7.0e-4, 1.2e-3, 1e-9, False),
    (4.1e-4, 8e-4, 1e-3, True),
    (4.1e-4, 8e-4, 1.1e-3, False),  # damped steps have no rate of convergence
    (4.1e-4, 4e-4, 1e-9, False),
    (3.9e-4, 1e-4, 1e-9, True),  # an increasing predicted decrease does not prevent convergence
])  # fmt: skip
def test_convergence_by_predicted_decrease(expected, before, damping, settled):
    """The predicted remaining decrease, extrapolated by how undamped steps shrink, decides on convergence.

    It is in squared sigmas, scaled by the residuals.
    """
    step = np.array([[1e-3, 0.0]])
    of = make_active(damping=damping, expected=before)
    assert _has_converged(of, step, np.array([expected]), LOOSE).tolist() == [settled]
    assert _scale(of).tolist() == [4.0]
    assert _scale(make_active(cost=np.inf)).tolist() == [1.0]


@pytest.mark.parametrize(("step", "eliminated", "before", "damping", "settled"), [
    ((0.9e-13, -0.9e-13), 0.0, 0.0, 1e-9, True),
    ((0.9e-13, -1.1e-13), 0.0, 0.0, 1e-9, False),
    ((0.0, 0.0), 4.1e-4, 0.0, 1e-9, False),  # the eliminated unknowns still move
    ((0.0, 0.0), 3.9e-4, 0.0, 1e-9, True),
    ((0.0, 0.0), 1.0, 0.0, 1.1e-3, True),  # rejected: it moves by rounding
    ((0.0, 0.0), 1.0, 0.0, 1e-3, False),
    ((0.0, 0.0), 1.0, 1.9, 1e-9, True),  # the same predicted decrease as before: rounding, too
    ((0.0, 0.0), 1.0, 2.1, 1e-9, False),
        ((0.0, 0.0), 1.0, 0.9, 1e-9, True),
])  # fmt: skip
def test_negligible_step_converges_if_eliminated_unknowns_rest(step, eliminated, before, damping, settled):
    """A step of at most 1e-13 on every axis ends the descent if the eliminated unknowns no longer move."""
    of = make_active(damping=damping, expected=before, eliminated=eliminated)
    assert _has_converged(of, np.array([step]), np.array([1.0]), LOOSE).tolist() == [settled]


@pytest.mark.parametrize(("expected", "before", "cost", "damping", "settled"), [
    (0.9e-12, 1.1e-12, 1.0, 1e-9, True),
    (1.1e-12, 1.1e-12, 1.0, 1e-9, False),  # the change is visible in the cost
    (0.9e-12, 1.9e-12, 1.0, 1e-9, False),  # half of the previous predicted decrease: steps still shrink
    (0.9e-12, 0.0, 1.0, 1e-9, False),
    (0.9e-12, 0.0, 1.0, 1.1e-3, True),
    (0.9e-12, 1.1e-12, np.inf, 1e-9, False),
])  # fmt: skip
def test_predicted_decrease_below_rounding_converges(expected, before, cost, damping, settled):
    """A predicted decrease below 1e-12 of the cost ends the descent once it no longer shrinks.

    Along directions known to degrees, the gradient's rounding predicts that much for ever.
    """
    of = make_active(cost=cost, dof=1.0, damping=damping, expected=before)
    found = _has_converged(of, np.array([[1e-3, 0.0]]), np.array([expected]), Criteria(tolerance=1e-9))
    assert found.tolist() == [settled]


@pytest.mark.parametrize(("damping", "slope", "undamped"), [
    (1e-3, 1.0, True), (1.1e-3, 1.0, False), (1e3, 1.9e-2, True), (1e3, 2.1e-2, False),
])  # fmt: skip
def test_negligible_damping_counts_as_gauss_newton(damping, slope, undamped):
    """Damping below 1e-3 counts as none.

    With more, the undamped step, whose square of sigmas is 4e-4, has to be negligible.
    """
    of = make_active(damping=damping, gradient=(slope, 0.0))
    assert _is_gauss_newton(of, LOOSE).tolist() == [undamped]


@pytest.mark.parametrize(
    ("gain", "factor"), [(1.0, 0.1), (0.75, 0.875), (0.5, 1.0), (0.25, 1.125), (0.0, 2.0), (99, 0.1)]
)
def test_accepted_step_reduces_damping_by_gain(gain, factor):
    """Damping changes by Nielsen's cubic of actual over predicted decrease, and its growth restarts from two."""
    of = make_active(cost=300.0, damping=0.5, growth=16.0, expected=7.0)
    after = make_active(cost=300.0 - 2 * gain).linearisation
    moved = _accept_step(of, np.ones((1, 2)), after, after.cost, YES, np.array([2.0]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(0.5 * factor)
    assert (moved.growth[0], moved.expected[0], moved.cost[0]) == (2.0, 2.0, 300.0 - 2 * gain)
    assert (moved.linearisation is after, moved.state.tolist(), moved.residual_curvature) == (True, [[1.0, 1.0]], None)


@pytest.mark.parametrize(("damping", "stiffened"), [(0.5, 8.0), (1e-9, 1.6e-2)])
def test_rejected_step_increases_damping_ever_faster(damping, stiffened):
    """Damping grows from at least 1e-3, and the rest of the state is unchanged."""
    of = make_active(damping=damping, growth=16.0, expected=7.0)
    after = make_active(cost=9.0).linearisation
    moved = _accept_step(of, np.ones((1, 2)), after, after.cost, ~YES, np.array([2.0]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(stiffened)
    assert (moved.growth[0], moved.expected[0], moved.cost[0]) == (32.0, 7.0, 8.0)
    assert (moved.linearisation is of.linearisation, moved.state.tolist()) == (True, [[0.0, 0.0]])


@pytest.mark.parametrize(("before", "after", "factor"), [
    (np.inf, np.inf, 0.1), (np.inf, 5.0, 0.1), (1.0, 1.0 + 0.9e-12, 0.1), (1.0, 1.0 - 6e-12, 0.875),
    (1.0, 1.0 - 7.2e-12, 0.1),
])  # fmt: skip
def test_uninformative_costs_do_not_reduce_the_gain(before, after, factor):
    """Infinite costs, or changes of cost within rounding of a tiny predicted decrease, count as a full gain."""
    about = make_active(cost=after).linearisation
    of = make_active(cost=before, damping=0.5)
    promised = 1e-14 if not before - after > 1e-12 else 8e-12
    moved = _accept_step(of, np.ones((1, 2)), about, about.cost, YES, np.array([promised]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(0.5 * factor, rel=1e-3)


def test_damping_has_a_lower_bound():
    """At the lower bound of 1e-9 a step is a Gauss-Newton step."""
    about = make_active(cost=6.0).linearisation
    moved = _accept_step(
        make_active(damping=2e-9), np.ones((1, 2)), about, about.cost, YES, np.array([2.0]), None, FIRST_DAMPING
    )
    assert moved.damping[0] == 1e-9


@pytest.mark.parametrize(("dof", "limit"), [(2.0, 0.8), (2000.0, 0.4)])
def test_near_optimum_is_a_sigma_and_a_cost_share(dof, limit):
    """A state is near the optimum within a sigma and a thousandth of the cost.

    The predicted decrease of a cost of 800 decides.
    """
    of = make_active(cost=800.0, dof=dof)
    assert _is_near(of, np.array([0.99 * limit])).all()
    assert not _is_near(of, np.array([1.01 * limit])).any()


def test_next_step_uses_residual_curvature():
    """The step includes the curvature of residuals if that is downhill, else the Hessian alone.

    Eliminated unknowns add their own predicted decrease.
    """
    of = make_active(gradient=(2.0, 1.0), hessian=np.diag([4.0, 1.0]), eliminated=0.25)
    for curvature, step in ((np.diag([0, 0.0]), (-0.5, -1.0)), (np.diag([4.0, 1.0]), (-0.25, -0.5))):
        found, expected = _next_step(replace(of, residual_curvature=curvature[None]))
        np.testing.assert_allclose(found, [step], rtol=1e-6)
        assert expected == pytest.approx(np.sum(np.square(step) * np.diag(np.diag([4.0, 1.0]) + curvature)) + 0.25)
    uphill = np.array([[0.0, 5.0], [5.0, 0.0]])  # its step predicts an increase of the cost
    of = make_active(gradient=(1.0, -1.0), hessian=np.diag([4.0, 1.0]), eliminated=0.25)
    found, expected = _next_step(replace(of, residual_curvature=uphill[None]))
    np.testing.assert_allclose(found, [(-0.25, 1.0)], rtol=1e-6)
    assert expected == pytest.approx(1.5)


def test_damped_step_raises_the_scaled_diagonal():
    """The step is independent of the unknowns' units. A column without information is scaled by 1e-12."""
    hessian = np.array([[4.0, 1.0, 0.0], [1.0, 900.0, 0.0], [0.0, 0.0, 0.0]])
    gradient = np.array([1.0, -3.0, 1e-12])
    about = Quadratic(np.zeros(1), gradient[None], hessian[None])
    raised = hessian + 0.5 * np.diag([4.0, 900.0, 900e-12])
    np.testing.assert_allclose(_damped_step(about, np.array([0.5]))[0], -np.linalg.solve(raised, gradient), rtol=1e-9)


@pytest.mark.parametrize("ended", [([2, 0], [1]), ([2], [1, 0]), ([0, 2], [1]), ([1], [0, 2]), ([0], [1, 2])])
def test_results_keep_the_order_of_problems(ended):
    """Results are in the order of the problems, whichever ended first."""
    ends = []
    for rows, converged in zip(ended, (True, False), strict=True):
        cost = 10.0 * np.array(rows)
        about = Quadratic(*(np.array([cost]).T for _ in range(4)))
        flight = _Active(np.array(rows), cost, cost, about, cost, cost, cost, cost, None)
        ends.append(flight.end(cost, cost, converged, 5 + converged))
    found = join_ends(ends)
    assert found.cost.tolist() == found.state.tolist() == found.linearisation.cost[:, 0].tolist() == [0.0, 10.0, 20.0]
    assert found.converged.tolist() == [row in ended[0] for row in range(3)]
    assert found.iterations.tolist() == [6 if row in ended[0] else 5 for row in range(3)]


@pytest.mark.parametrize("iterations", [1, 3])
def test_iteration_limit_is_respected(iterations):
    """If no step is left, a problem ends at its current state and is not converged."""
    found = levenberg_marquardt(
        curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=iterations, tolerance=0.0)
    )
    assert (found.iterations.tolist(), found.converged.any()) == ([iterations] * 4, False)


YES = np.array([True])


def test_failing_problem_does_not_stop_the_batch():
    """Beside a curve that converges, a problem whose every step is not finite is given up at its state."""
    system = replace(curves(), singular_above=3.0)
    starts = np.array([[1.0, 1.0], [1.0, 3.0 - 1e-9]])
    seen = np.stack([curves().seen[0], np.exp(-50 * Exponentials.times)])
    optima = levenberg_marquardt(replace(system, seen=seen), starts, Criteria(iterations=200))
    assert optima.converged.tolist()[0]
    np.testing.assert_allclose(optima.state[0], TRUE[0], atol=1e-6)
    assert optima.state[1, 1] <= 3.0


@dataclass(frozen=True, eq=False)
class Parabola:
    """A parabola of curvature 4 about 2, with a minimum of 0.3."""

    def linearise(self, state):
        x = state[:, 0] - 2.0
        return Linearisation(4 * x**2 + 0.3, 4 * x[:, None], np.full((len(x), 1, 1), 4.0))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return self


def test_cost_is_predicted_after_the_last_step():
    """The final cost is computed from the predicted decrease, without another evaluation."""
    loose = levenberg_marquardt(Parabola(), np.array([[2.1], [1.8]]), Criteria(tolerance=1.0))
    assert (loose.iterations.tolist(), loose.converged.tolist()) == ([1, 1], [True, True])
    np.testing.assert_allclose(loose.state, 2.0, atol=1e-6)
    np.testing.assert_allclose(loose.cost, 0.3, atol=1e-8)
    np.testing.assert_allclose(loose.linearisation.cost, [0.34, 0.46])
