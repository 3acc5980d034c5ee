"""Levenberg-Marquardt on curve fits whose optima are known."""

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
class About:
    """Curves to second order."""

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array | float = 0.0


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
    optima = levenberg_marquardt(curves(), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)
    assert len(set(optima.iterations)) > 1


@pytest.mark.parametrize("row", range(4))
def test_a_batch_is_each_problem_by_itself(row):
    """Noisy curves: a problem takes the same steps to the same end alone and among others."""
    start = np.tile([1.0, 1.0], (4, 1))
    together = levenberg_marquardt(curves(0.1), start, Criteria(dof=18))
    alone = levenberg_marquardt(curves(0.1).take([row]), start[[row]], Criteria(dof=18))
    np.testing.assert_allclose(together.state[row], alone.state[0], atol=1e-12)
    assert together.iterations[row] == alone.iterations[0]


def test_no_step_goes_uphill():
    """Stopped after any number of steps, no cost is above that of fewer steps."""
    start = np.tile([1.0, 1.0], (4, 1))
    costs = [levenberg_marquardt(curves(0.1), start, Criteria(iterations=k)).cost for k in range(1, 40)]
    assert np.all(np.diff(costs, axis=0) <= 1e-12)
    assert np.all(costs[-1] < 0.5 * curves(0.1).linearise(start).cost)


def test_the_end_is_where_the_gradient_vanishes():
    """At the ends the gradient is zero to 1e-4 sigmas."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(dof=18))
    about = curves(0.1).linearise(optima.state)
    left = np.einsum("bi,bi->b", about.gradient, np.linalg.solve(about.hessian, about.gradient[..., None])[..., 0])
    assert np.all(left <= 1e-8 * about.cost / 18)


def test_a_state_beyond_numbers_is_a_step_refused():
    """Where a problem cannot be linearised its step is refused, and the others of the batch go on."""
    system = replace(curves(), singular_above=5.5)
    optima = levenberg_marquardt(system, np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=200))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, TRUE, atol=1e-9)


def test_not_converged_is_said():
    """Two steps from a rough start are not enough, and that is what the result says."""
    optima = levenberg_marquardt(curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=2))
    assert not optima.converged.any()
    assert np.all(optima.iterations == 2)


def test_looser_ends_come_sooner_and_stay_within_what_is_allowed():
    """A tenth of a sigma takes fewer steps than the default, and ends within two tenths of its optimum."""
    start = np.tile([1.0, 1.0], (4, 1))
    tight = levenberg_marquardt(curves(0.1), start, Criteria(dof=18))
    loose = levenberg_marquardt(curves(0.1), start, Criteria(dof=18, tolerance=0.1))
    assert loose.converged.all()
    assert loose.iterations.sum() < tight.iterations.sum()
    off, hessian = loose.state - tight.state, curves(0.1).linearise(tight.state).hessian
    assert np.all(np.einsum("bi,bij,bj->b", off, hessian, off) <= 0.2**2 * tight.cost / 18)
    assert np.any(np.abs(off) > 1e-9)


def by_hand(system, row, x, steps):
    """The state after so many steps of one problem, with Nielsen's damping of the diagonal."""
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
    """As by hand where none counts as near its end, whether steps are taken or refused; most have not ended by then."""
    start = np.tile(first, (4, 1))
    with np.errstate(all="ignore"):
        optima = levenberg_marquardt(curves(0.1), start, Criteria(iterations=steps, tolerance=1e-12, dof=1e12))
        wanted = [by_hand(curves(0.1), row, start[row], steps) for row in range(4)]
    going = optima.iterations == steps
    np.testing.assert_allclose(optima.state[going], np.array(wanted)[going], rtol=1e-7)
    assert np.count_nonzero(going) >= (4 if steps < 5 else 1)


@dataclass(frozen=True, eq=False)
class Misled:
    """A slope that is told the wrong way round: no step is any good."""

    slope: float = 1.0

    def linearise(self, state):
        return About(10.0 + state[:, 0], np.full((len(state), 1), -self.slope), np.ones((len(state), 1, 1)))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return self


@dataclass(frozen=True, eq=False)
class Bent:
    """Residuals x + 1 and c x^2 + x - 1 of each problem's c: Gauss-Newton's steps about the optimum 0 go by 1 + c."""

    c: Array

    def linearise(self, state):
        x = state[:, 0]
        residual = np.stack([x + 1, self.c * x**2 + x - 1], -1)
        jacobian = np.stack([np.ones_like(x), 2 * self.c * x + 1], -1)
        gradient = np.einsum("bi,bi->b", jacobian, residual)[:, None]
        return About(np.sum(residual**2, -1), gradient, np.sum(jacobian**2, -1)[:, None, None])

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return replace(self, c=self.c[rows])


def test_residuals_that_bend_delay_no_end():
    """Where steps overshoot the optimum by up to 0.9 of their way, or fall short of it, ten find it to 1e-5 sigma."""
    system = Bent(np.array([-0.9, -0.5, 0.0, 0.4, 0.7]))
    optima = levenberg_marquardt(system, np.full((5, 1), 0.01), Criteria(iterations=10))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state[:, 0], 0.0, atol=1.5e-5)


@pytest.mark.parametrize("c", [-3.0, -30.0])
def test_curvature_far_beyond_that_of_jacobians_is_found_by_damped_steps(c):
    """Gauss-Newton's steps are four and thirty times too long: damped ones alone took 18 and 44."""
    optimum = levenberg_marquardt(Bent(np.array([c])), np.full((1, 1), 0.01), Criteria(iterations=100))
    assert optimum.converged[0]
    assert optimum.iterations[0] <= 15
    np.testing.assert_allclose(optimum.state[:, 0], 0.0, atol=1.5e-5)


@dataclass(frozen=True, eq=False)
class Shadowed:
    """(x - y)^2 + (y - 1)^2 / 100 of x and of y, which is eliminated and goes but half of its way at each step."""

    def linearise(self, state):
        x, y = state.T
        force = y - x + (y - 1) / 100
        gradient = (x - y) + force / 1.01
        cost = (x - y) ** 2 + (y - 1) ** 2 / 100
        return About(cost, gradient[:, None], np.full((len(x), 1, 1), 1 - 1 / 1.01), force**2 / 1.01)

    def retract(self, state, about, step):
        x, y = state.T
        best = (x + step[:, 0] + 0.01) / 1.01
        return np.stack([x + step[:, 0], (y + best) / 2], -1)

    def take(self, rows):
        return self


def test_nothing_ends_while_what_is_eliminated_still_moves():
    """From the best x, but a y far away: both are found, to what may be left to go."""
    optima = levenberg_marquardt(Shadowed(), np.array([[1.0, 5.0], [-3.0, 1.0]]), Criteria(dof=1e4, tolerance=1e-6))
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, 1.0, atol=1e-3)


@pytest.mark.parametrize(("slope", "converged", "steps"), [(1.0, True, 8), (1e12, False, 10)])
def test_where_no_step_is_any_good(slope, converged, steps):
    """Each is damped the more: one that is nothing to the data ends there, one beyond all damping is given up."""
    optima = levenberg_marquardt(Misled(slope), np.array([[3.0], [5.0]]), Criteria(iterations=50))
    np.testing.assert_array_equal(optima.state, [[3.0], [5.0]])
    np.testing.assert_array_equal(optima.cost, [13.0, 15.0])
    assert optima.converged.tolist() == [converged] * 2
    assert optima.iterations.tolist() == [steps] * 2


def test_a_direction_that_nothing_holds_is_no_error():
    """An unknown that moves nothing stays, the other finds its optimum."""

    @dataclass(frozen=True, eq=False)
    class Half(Misled):
        """A parabola of the first of two unknowns."""

        def linearise(self, state):
            gradient = np.stack([state[:, 0] - 2.0, np.zeros(len(state))], 1)
            return About((state[:, 0] - 2.0) ** 2, gradient, np.tile(np.diag([1.0, 0.0]), (len(state), 1, 1)))

    optima = levenberg_marquardt(Half(), np.array([[0.0, 7.0]]), Criteria())
    assert optima.converged.all()
    np.testing.assert_allclose(optima.state, [[2.0, 7.0]], atol=1e-6)


def flight(cost=8.0, dof=2.0, damping=1e-9, growth=2.0, expected=0.0, eliminated=0.0, hessian=None, gradient=(0, 0)):
    """One problem of two unknowns, on its way."""
    hessian = np.eye(2) if hessian is None else np.array(hessian, dtype=float)
    about = Quadratic(np.array([cost]), np.array([gradient], dtype=float), hessian[None], np.array([eliminated]))
    numbers = (np.array([float(of)]) for of in (dof, damping, growth, expected))
    return _Active(np.array([0]), np.zeros((1, 2)), np.array([cost]), about, *numbers, np.zeros((1, 2, 2)))


LOOSE = Criteria(tolerance=1e-2)  # of a scale of 4: at most 4e-4 may be left


@pytest.mark.parametrize(("expected", "before", "damping", "settled"), [
    (3.9e-4, 0.0, 1e-9, True),
    (4.1e-4, 0.0, 1e-9, False),
    (4.1e-4, 8e-4, 1e-9, True),  # half as much as before: as much again is left in all
    (7.0e-4, 1.2e-3, 1e-9, False),
    (4.1e-4, 8e-4, 1e-3, True),
    (4.1e-4, 8e-4, 1.1e-3, False),  # how damped steps shrink says nothing
    (4.1e-4, 4e-4, 1e-9, False),
    (3.9e-4, 1e-4, 1e-9, True),  # that a step promises more than the last is no reason to go on
])  # fmt: skip
def test_what_is_left_to_go_is_what_a_step_promises_by_how_steps_shrink(expected, before, damping, settled):
    """In squares of sigmas, scaled by the residuals."""
    step = np.array([[1e-3, 0.0]])
    of = flight(damping=damping, expected=before)
    assert _has_converged(of, step, np.array([expected]), LOOSE).tolist() == [settled]
    assert _scale(of).tolist() == [4.0]
    assert _scale(flight(cost=np.inf)).tolist() == [1.0]


@pytest.mark.parametrize(("step", "eliminated", "before", "damping", "settled"), [
    ((0.9e-13, -0.9e-13), 0.0, 0.0, 1e-9, True),
    ((0.9e-13, -1.1e-13), 0.0, 0.0, 1e-9, False),
    ((0.0, 0.0), 4.1e-4, 0.0, 1e-9, False),  # what is eliminated still moves
    ((0.0, 0.0), 3.9e-4, 0.0, 1e-9, True),
    ((0.0, 0.0), 1.0, 0.0, 1.1e-3, True),  # refused: it moves by rounding
    ((0.0, 0.0), 1.0, 0.0, 1e-3, False),
    ((0.0, 0.0), 1.0, 1.9, 1e-9, True),  # it promises as much as before: likewise
    ((0.0, 0.0), 1.0, 2.1, 1e-9, False),
        ((0.0, 0.0), 1.0, 0.9, 1e-9, True),
])  # fmt: skip
def test_a_step_that_is_none_settles_where_nothing_else_moves(step, eliminated, before, damping, settled):
    """By 1e-13 on every axis."""
    of = flight(damping=damping, expected=before, eliminated=eliminated)
    assert _has_converged(of, np.array([step]), np.array([1.0]), LOOSE).tolist() == [settled]


@pytest.mark.parametrize(("expected", "before", "cost", "damping", "settled"), [
    (0.9e-12, 1.1e-12, 1.0, 1e-9, True),
    (1.1e-12, 1.1e-12, 1.0, 1e-9, False),  # the cost still shows it
    (0.9e-12, 1.9e-12, 1.0, 1e-9, False),  # it is half of what was promised before: steps still shrink
    (0.9e-12, 0.0, 1.0, 1e-9, False),
    (0.9e-12, 0.0, 1.0, 1.1e-3, True),
    (0.9e-12, 1.1e-12, np.inf, 1e-9, False),
])  # fmt: skip
def test_promises_that_a_cost_cannot_show_settle_where_they_no_longer_fall(expected, before, cost, damping, settled):
    """Below 1e-12 of it: along directions known to degrees the gradient's rounding promises so much for ever."""
    of = flight(cost=cost, dof=1.0, damping=damping, expected=before)
    found = _has_converged(of, np.array([[1e-3, 0.0]]), np.array([expected]), Criteria(tolerance=1e-9))
    assert found.tolist() == [settled]


@pytest.mark.parametrize(("damping", "slope", "undamped"), [
    (1e-3, 1.0, True), (1.1e-3, 1.0, False), (1e3, 1.9e-2, True), (1e3, 2.1e-2, False),
])  # fmt: skip
def test_damping_hides_no_step_that_could_be_seen(damping, slope, undamped):
    """Below a thousandth it is none; else the step without it, whose square of sigmas is 4e-4, has to be nothing."""
    of = flight(damping=damping, gradient=(slope, 0.0))
    assert _is_gauss_newton(of, LOOSE).tolist() == [undamped]


@pytest.mark.parametrize(
    ("gain", "factor"), [(1.0, 0.1), (0.75, 0.875), (0.5, 1.0), (0.25, 1.125), (0.0, 2.0), (99, 0.1)]
)
def test_a_step_taken_eases_the_damping_by_what_it_gained(gain, factor):
    """Over what it promised, by Nielsen's cubic; the next refusal counts from two."""
    of = flight(cost=300.0, damping=0.5, growth=16.0, expected=7.0)
    after = flight(cost=300.0 - 2 * gain).linearisation
    moved = _accept_step(of, np.ones((1, 2)), after, after.cost, YES, np.array([2.0]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(0.5 * factor)
    assert (moved.growth[0], moved.expected[0], moved.cost[0]) == (2.0, 2.0, 300.0 - 2 * gain)
    assert (moved.linearisation is after, moved.state.tolist(), moved.residual_curvature) == (True, [[1.0, 1.0]], None)


@pytest.mark.parametrize(("damping", "stiffened"), [(0.5, 8.0), (1e-9, 1.6e-2)])
def test_a_step_refused_stiffens_the_damping_ever_faster(damping, stiffened):
    """From a thousandth on; all else stays as it was."""
    of = flight(damping=damping, growth=16.0, expected=7.0)
    after = flight(cost=9.0).linearisation
    moved = _accept_step(of, np.ones((1, 2)), after, after.cost, ~YES, np.array([2.0]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(stiffened)
    assert (moved.growth[0], moved.expected[0], moved.cost[0]) == (32.0, 7.0, 8.0)
    assert (moved.linearisation is of.linearisation, moved.state.tolist()) == (True, [[0.0, 0.0]])


@pytest.mark.parametrize(("before", "after", "factor"), [
    (np.inf, np.inf, 0.1), (np.inf, 5.0, 0.1), (1.0, 1.0 + 0.9e-12, 0.1), (1.0, 1.0 - 6e-12, 0.875),
    (1.0, 1.0 - 7.2e-12, 0.1),
])  # fmt: skip
def test_what_costs_do_not_tell_says_nothing_of_the_damping(before, after, factor):
    """Infinite ones, or by rounding of a step that promises next to nothing: it counts as having gained that."""
    about = flight(cost=after).linearisation
    of = flight(cost=before, damping=0.5)
    promised = 1e-14 if not before - after > 1e-12 else 8e-12
    moved = _accept_step(of, np.ones((1, 2)), about, about.cost, YES, np.array([promised]), None, FIRST_DAMPING)
    assert moved.damping[0] == pytest.approx(0.5 * factor, rel=1e-3)


def test_damping_has_an_end_below():
    """At which a step is one of Gauss-Newton."""
    about = flight(cost=6.0).linearisation
    moved = _accept_step(
        flight(damping=2e-9), np.ones((1, 2)), about, about.cost, YES, np.array([2.0]), None, FIRST_DAMPING
    )
    assert moved.damping[0] == 1e-9


@pytest.mark.parametrize(("dof", "limit"), [(2.0, 0.8), (2000.0, 0.4)])
def test_near_is_within_a_sigma_and_a_thousandth_of_the_cost(dof, limit):
    """By what a step promises, of a cost of 800."""
    of = flight(cost=800.0, dof=dof)
    assert _is_near(of, np.array([0.99 * limit])).all()
    assert not _is_near(of, np.array([1.01 * limit])).any()


def test_the_next_step_goes_by_what_residuals_bend():
    """Where that leads downhill; else by the hessian alone. What is eliminated promises its own."""
    of = flight(gradient=(2.0, 1.0), hessian=np.diag([4.0, 1.0]), eliminated=0.25)
    for curvature, step in ((np.diag([0, 0.0]), (-0.5, -1.0)), (np.diag([4.0, 1.0]), (-0.25, -0.5))):
        found, expected = _next_step(replace(of, residual_curvature=curvature[None]))
        np.testing.assert_allclose(found, [step], rtol=1e-6)
        assert expected == pytest.approx(np.sum(np.square(step) * np.diag(np.diag([4.0, 1.0]) + curvature)) + 0.25)
    uphill = np.array([[0.0, 5.0], [5.0, 0.0]])  # its step promises less than nothing
    of = flight(gradient=(1.0, -1.0), hessian=np.diag([4.0, 1.0]), eliminated=0.25)
    found, expected = _next_step(replace(of, residual_curvature=uphill[None]))
    np.testing.assert_allclose(found, [(-0.25, 1.0)], rtol=1e-6)
    assert expected == pytest.approx(1.5)


def test_a_damped_step_is_that_of_the_scaled_diagonal_raised():
    """Whatever the units of the unknowns; a column without information scales by a millionth of a millionth."""
    hessian = np.array([[4.0, 1.0, 0.0], [1.0, 900.0, 0.0], [0.0, 0.0, 0.0]])
    gradient = np.array([1.0, -3.0, 1e-12])
    about = Quadratic(np.zeros(1), gradient[None], hessian[None])
    raised = hessian + 0.5 * np.diag([4.0, 900.0, 900e-12])
    np.testing.assert_allclose(_damped_step(about, np.array([0.5]))[0], -np.linalg.solve(raised, gradient), rtol=1e-9)


@pytest.mark.parametrize("ended", [([2, 0], [1]), ([2], [1, 0]), ([0, 2], [1]), ([1], [0, 2]), ([0], [1, 2])])
def test_ends_are_told_in_the_order_of_their_problems(ended):
    """Whichever ended first."""
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
def test_no_more_steps_are_tried_than_may_be(iterations):
    """Where none is left a problem ends where it is, not converged."""
    found = levenberg_marquardt(
        curves(0.1), np.tile([1.0, 1.0], (4, 1)), Criteria(iterations=iterations, tolerance=0.0)
    )
    assert (found.iterations.tolist(), found.converged.any()) == ([iterations] * 4, False)


YES = np.array([True])


def test_one_that_goes_nowhere_leaves_the_others_going():
    """Beside a curve that is found, one whose every step is beyond numbers is given up where it is."""
    system = replace(curves(), singular_above=3.0)
    starts = np.array([[1.0, 1.0], [1.0, 3.0 - 1e-9]])
    seen = np.stack([curves().seen[0], np.exp(-50 * Exponentials.times)])
    optima = levenberg_marquardt(replace(system, seen=seen), starts, Criteria(iterations=200))
    assert optima.converged.tolist()[0]
    np.testing.assert_allclose(optima.state[0], TRUE[0], atol=1e-6)
    assert optima.state[1, 1] <= 3.0


@dataclass(frozen=True, eq=False)
class Straight:
    """A parabola of curvature 4 about 2, of which 0.3 are left at its best."""

    def linearise(self, state):
        x = state[:, 0] - 2.0
        return About(4 * x**2 + 0.3, 4 * x[:, None], np.full((len(x), 1, 1), 4.0))

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return self


def test_the_cost_is_that_after_the_last_step():
    """Though nothing is computed there: by what the step has promised."""
    loose = levenberg_marquardt(Straight(), np.array([[2.1], [1.8]]), Criteria(tolerance=1.0))
    assert (loose.iterations.tolist(), loose.converged.tolist()) == ([1, 1], [True, True])
    np.testing.assert_allclose(loose.state, 2.0, atol=1e-6)
    np.testing.assert_allclose(loose.cost, 0.3, atol=1e-8)
    np.testing.assert_allclose(loose.linearisation.cost, [0.34, 0.46])
