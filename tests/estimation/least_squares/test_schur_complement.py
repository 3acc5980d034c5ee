"""Tests of the elimination of shared stops against the dense system of all of them."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.least_squares import schur_complement
from basecal.estimation.least_squares.schur_complement import SchurAccumulator, StopViews

STOPS, VIEWS, WIDTH = 4, 7, 5
EYE = np.array([0, 0, 1, 1, 1, 0, 1])
HAND = np.array([2, 3, 2, 3, 3, 2, 2])


def random_values(rng, batch=()):
    """Stop errors, and gradient, information and derivatives of views by unknowns, eye and hand stops."""
    root = rng.standard_normal((*batch, VIEWS, 6, 6))
    return (
        rng.standard_normal((*batch, STOPS, 6)),
        rng.standard_normal((*batch, VIEWS, 6)),
        root @ np.swapaxes(root, -1, -2),
        rng.standard_normal((*batch, VIEWS, 6, WIDTH - 1)),
        rng.standard_normal((2, *batch, VIEWS, 6, 6)),
    )


def eliminate_stops(values, robots):
    """The elimination of stops of the eye, the hand or both; the second unknown moves no view."""
    errors, gradient, information, by_unknowns, by_error = values
    sums = SchurAccumulator(errors, WIDTH)
    rows = np.arange(VIEWS)
    shared = [StopViews(rows, {0: EYE, 1: HAND}[r], by_error[r]) for r in robots]
    sums.add(shared, gradient, information, by_unknowns, np.array([0, 2, 3, 4]))
    return sums.solve()


def dense_system(values, robots):
    """Information of the errors, mixed terms with the unknowns, and gradient of the errors."""
    errors, gradient, information, by_unknowns, by_error = values
    full = np.zeros((VIEWS, 6, STOPS, 6))
    for r in robots:
        full[np.arange(VIEWS), :, {0: EYE, 1: HAND}[r]] += by_error[r]
    full = full.reshape(VIEWS, 6, 6 * STOPS)
    derivative = np.insert(by_unknowns, 1, 0.0, axis=-1)
    own = np.eye(6 * STOPS) + np.einsum("nqi,nqr,nrj->ij", full, information, full)
    mixed = np.einsum("nqi,nqr,nrj->ij", full, information, derivative)
    return own, mixed, errors.ravel() + np.einsum("nqi,nq->i", full, gradient)


@pytest.mark.parametrize("robots", [(0,), (0, 1)])
def test_reduction_equals_the_dense_system(rng, robots):
    """Hessian, gradient, log determinant and the best step of errors agree, if one robot or both share stops."""
    values = random_values(rng)
    own, mixed, force = dense_system(values, robots)
    ours = eliminate_stops(values, robots)
    hessian, gradient = ours.reduce(np.zeros((WIDTH, WIDTH)), np.zeros(WIDTH))
    np.testing.assert_allclose(hessian, -mixed.T @ np.linalg.solve(own, mixed), atol=1e-9)
    np.testing.assert_allclose(gradient, -mixed.T @ np.linalg.solve(own, force), atol=1e-9)
    assert ours.log_det == pytest.approx(np.linalg.slogdet(own)[1])
    step = rng.standard_normal(WIDTH)
    np.testing.assert_allclose(ours.step(step).ravel(), -np.linalg.solve(own, force + mixed @ step), atol=1e-9)


def test_scene_terms_are_eliminated_with_their_stops(rng):
    """The result equals the dense system of three of four stops connected to one another and to some unknowns."""
    stop, wide = np.array([0, 2, 3]), WIDTH - 1
    errors, gradient = rng.standard_normal((STOPS, 6)), rng.standard_normal(18)
    by_unknowns, root = rng.standard_normal((18, wide)), rng.standard_normal((18, 18))
    sums = SchurAccumulator(errors, WIDTH)
    sums.add_scene(stop, gradient, by_unknowns, root @ root.T)
    rows = (6 * stop[:, None] + np.arange(6)).ravel()
    own, mixed, force = np.eye(6 * STOPS), np.zeros((6 * STOPS, WIDTH)), errors.ravel()
    own[np.ix_(rows, rows)] += root @ root.T
    mixed[rows, :wide] += by_unknowns
    force[rows] += gradient
    ours, step = sums.solve(), rng.standard_normal(WIDTH)
    assert ours.log_det == pytest.approx(np.linalg.slogdet(own)[1])
    np.testing.assert_allclose(ours.step(step).ravel(), -np.linalg.solve(own, force + mixed @ step), atol=1e-9)


@pytest.mark.parametrize("robots", [(0,), (0, 1)])
def test_covariance_is_the_inverse_information_of_errors(rng, robots):
    """Blocks are correct for any pair of stops."""
    values = random_values(rng)
    inverse = np.linalg.inv(dense_system(values, robots)[0]).reshape(STOPS, 6, STOPS, 6)
    first, second = np.array([0, 0, 2, 3]), np.array([0, 3, 1, 3])
    np.testing.assert_allclose(
        eliminate_stops(values, robots).covariance(first, second), inverse[first, :, second], atol=1e-9
    )


@pytest.mark.parametrize("robots", [(0,), (0, 1)])
def test_solution_at_some_stops_is_that_of_all(rng, robots):
    """Right-hand sides at some stops have the solution of the whole system at these stops."""
    values, stops = random_values(rng), np.array([1, 3])
    own, mixed, force = dense_system(values, robots)
    ours = eliminate_stops(values, robots)
    rows = np.arange(24).reshape(4, 6)[stops].ravel()
    right = rng.standard_normal((12, 2))
    np.testing.assert_allclose(
        ours.solve_stops(stops, right), np.linalg.inv(own)[np.ix_(rows, rows)] @ right, atol=1e-9
    )
    whole = np.linalg.solve(own, np.column_stack([mixed, force]))
    np.testing.assert_allclose(ours.stop_solutions(stops), whole[rows], atol=1e-9)


def test_covariance_of_many_stops_is_block_diagonal(rng, monkeypatch):
    """Beyond a limit of stops, correlations are left out: each stop has its block, with zeros between."""
    values = random_values(rng)
    ours = eliminate_stops(values, (0, 1))
    alone = np.linalg.inv(ours.precision)
    monkeypatch.setattr(schur_complement, "_MOST_INVERTED", STOPS - 1)
    found = ours.covariance(np.array([1, 1]), np.array([1, 3]))
    np.testing.assert_allclose(found[0], alone[1], atol=1e-12)
    np.testing.assert_array_equal(found[1], 0.0)
    monkeypatch.setattr(schur_complement, "_MOST_INVERTED", STOPS)
    assert np.abs(ours.covariance(np.array([1]), np.array([3]))).max() > 1e-6


@pytest.mark.parametrize("robots", [(0,), (0, 1)])
def test_batch_equals_separate_entries(rng, robots):
    """Reduction, log determinant and step of two entries equal those of each."""
    values = random_values(rng, (2,))
    together = eliminate_stops(values, robots)
    step = rng.standard_normal((2, WIDTH))
    hessian, gradient = together.reduce(np.zeros((2, WIDTH, WIDTH)), np.zeros((2, WIDTH)))
    for row in range(2):
        alone = eliminate_stops((*(v[row] for v in values[:-1]), values[-1][:, row]), robots)
        of_one = alone.reduce(np.zeros((WIDTH, WIDTH)), np.zeros(WIDTH))
        np.testing.assert_allclose(hessian[row], of_one[0], atol=1e-9)
        np.testing.assert_allclose(gradient[row], of_one[1], atol=1e-9)
        np.testing.assert_allclose(together.step(step)[row], alone.step(step[row]), atol=1e-9)
        assert together.log_det[row] == pytest.approx(alone.log_det)


def test_views_without_shared_stops_have_no_effect(rng):
    """Without views, errors have a sigma of one each, and the unknowns are unchanged."""
    values = random_values(rng)
    sums = SchurAccumulator(values[0], WIDTH)
    none = np.zeros(0, dtype=np.int64)
    sums.add([StopViews(none, none, np.zeros((0, 6, 6)))] * 2, *values[1:4], np.arange(WIDTH - 1))
    ours = sums.solve()
    assert ours.log_det == 0.0
    np.testing.assert_array_equal(ours.step(np.ones(WIDTH)), -values[0])
    np.testing.assert_array_equal(ours.reduce(np.eye(WIDTH), np.ones(WIDTH))[0], np.eye(WIDTH))


def test_overflow_raises_linalg_error(rng):
    """If a state pulled aside by outliers overflows, LinAlgError is raised, which every search handles."""
    errors, gradient, information, by_unknowns, by_error = random_values(rng)
    values = errors, gradient, np.where(information > 0, np.inf, information), by_unknowns, by_error
    with np.errstate(all="ignore"), pytest.raises(np.linalg.LinAlgError):
        eliminate_stops(values, (0, 1))


@pytest.mark.parametrize("robots", [(0,), (0, 1)])
def test_views_added_separately_equal_views_added_together(rng, robots):
    """Groups with one view per stop give the same sums as one group with shared stops."""
    errors, gradient, information, by_unknowns, by_error = random_values(rng)
    sums, columns = SchurAccumulator(errors, WIDTH), np.array([0, 2, 3, 4])
    for row in range(VIEWS):
        of, first = slice(row, row + 1), np.zeros(1, dtype=np.int64)
        shared = [StopViews(first, {0: EYE, 1: HAND}[r][of], by_error[r][of]) for r in robots]
        sums.add(shared, gradient[of], information[of], by_unknowns[of], columns)
    ours, together = sums.solve(), eliminate_stops((errors, gradient, information, by_unknowns, by_error), robots)
    for name in ("by_unknowns", "solution", "eliminated_cost", "log_det", "precision"):
        np.testing.assert_allclose(getattr(ours, name), getattr(together, name), rtol=1e-9, atol=1e-9)
