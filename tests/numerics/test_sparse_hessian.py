"""Tests of sparse Hessians against dense ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csc_array

from basecal.numerics.levenberg_marquardt import Criteria, Quadratic, _damped_step, levenberg_marquardt
from basecal.numerics.sparse_hessian import SparseHessian


@pytest.fixture
def dense(rng):
    """A band matrix of information on 12 unknowns of very different sizes, (12, 12)."""
    rows = np.eye(12) + 0.3 * np.eye(12, k=1) + 0.1 * rng.standard_normal((12, 12)) * (np.eye(12) + np.eye(12, k=3))
    rows = rows * np.geomspace(1, 1e3, 12)
    return rows.T @ rows


def test_damped_steps_equal_dense_ones(dense, rng) -> None:
    """Steps and predicted decreases equal those of the dense Hessian, damped or not."""
    gradient, sparse = rng.standard_normal((1, 12)), SparseHessian(csc_array(dense))
    for damping in (1e-9, 0.1, 100.0):
        expected = _damped_step(Quadratic(np.zeros(1), gradient, dense[None]), np.array([damping]))
        np.testing.assert_allclose(sparse.damped_step(gradient, np.array([damping])), expected, rtol=1e-9)
    np.testing.assert_allclose(sparse.quadratic(gradient), gradient @ dense @ gradient[0])


def test_inverse_columns_and_blocks(dense) -> None:
    """Columns and blocks of the inverse are those of the dense inverse, and blocks are symmetric."""
    sparse, inverse = SparseHessian(csc_array(dense)), np.linalg.inv(dense)
    np.testing.assert_allclose(sparse.inverse_columns(np.array([3, 7])), inverse[:, [3, 7]], rtol=1e-9)
    found = sparse.inverse_block(np.array([11, 0, 5]))
    np.testing.assert_allclose(found, inverse[np.ix_([11, 0, 5], [11, 0, 5])], rtol=1e-9)
    np.testing.assert_array_equal(found, found.T)


def test_extremes_are_eigenvalues(dense) -> None:
    """The smallest and largest eigenvalue are found in any units.

    The smallest is zero if a direction is missing or known by rounding alone.
    """
    values = np.linalg.eigvalsh(dense)
    assert SparseHessian(csc_array(dense)).extremes == pytest.approx((values[0], values[-1]), rel=5e-3)
    scale = np.geomspace(1, 1e-3, 12)
    scaled = SparseHessian(csc_array(dense)).rescale(scale)
    np.testing.assert_allclose(scaled.matrix.toarray(), dense * scale * scale[:, None])
    rows = np.eye(12)
    rows[4] = rows[5]
    assert SparseHessian(csc_array(rows.T @ rows)).extremes[0] == 0.0
    rows[4] = rows[5] + rows[6]
    rows[6] = rows[5] - rows[7]
    rows[7] = rows[4] - rows[6]
    assert SparseHessian(csc_array(rows.T @ rows)).extremes[0] == 0.0


def test_non_finite_hessian_has_no_step(dense) -> None:
    """A Hessian with an infinite entry gives a step of NaN, as a dense one does."""
    dense[0, 0] = np.inf
    step = SparseHessian(csc_array(dense)).damped_step(np.ones((1, 12)), np.array([1e-9]))
    assert np.isnan(step).all()


class _LinearProblem:
    """A linear least squares problem for Levenberg-Marquardt."""

    def __init__(self, dense):
        self.hessian = SparseHessian(csc_array(dense))

    def linearise(self, state):
        gradient = self.hessian.matrix @ (state[0] - 1)
        return Quadratic(np.array([(state[0] - 1) @ gradient + 2.0]), gradient[None], self.hessian)

    def retract(self, state, about, step):
        return state + step

    def take(self, rows):
        return self


def test_levenberg_marquardt_accepts_sparse_hessians(dense) -> None:
    """The descent reaches the optimum, at which every unknown is one."""
    found = levenberg_marquardt(_LinearProblem(dense), np.zeros((1, 12)), Criteria())
    assert found.converged.all()
    np.testing.assert_allclose(found.state, 1.0, atol=1e-6)


def test_inverse_blocks_of_large_matrices() -> None:
    """Columns are correct if more are requested, in any order, than are solved for at a time."""
    rng = np.random.default_rng(0)
    dense = np.diag(rng.uniform(1, 2, 560)) + np.diag(np.full(559, 0.3), 1) + np.diag(np.full(559, 0.3), -1)
    sparse, columns = SparseHessian(csc_array(dense)), rng.permutation(560)[:530]
    inverse = np.linalg.inv(dense)
    np.testing.assert_allclose(sparse.inverse_columns(columns), inverse[:, columns], atol=1e-12)
    np.testing.assert_allclose(sparse.inverse_block(columns), inverse[np.ix_(columns, columns)], atol=1e-12)


@pytest.mark.parametrize(("smallest", "found"), [(3e-12, 3e-12), (3e-13, 0.0)])
def test_eigenvalue_at_rounding_is_zero(smallest: float, found: float) -> None:
    """An eigenvalue below 1e-12 of the largest is zero, whatever the size of the matrix."""
    values = np.append(np.geomspace(1e-3, 1.0, 8), smallest)
    for size in (1.0, 1e6, 1e-6):
        extremes = SparseHessian(csc_array(np.diag(size * values))).extremes
        assert extremes == pytest.approx((size * found, size), rel=5e-3, abs=0.0)


def test_column_without_information_is_scaled_by_the_largest() -> None:
    """The scale of such a column is 1e-12 of the largest diagonal entry, as with dense Hessians.

    A small gradient along it is damped by that.
    """
    hessian, gradient = np.diag([4.0, 900.0, 0.0]), np.array([[1.0, -3.0, 1e-12]])
    raised = hessian + 0.5 * np.diag([4.0, 900.0, 900e-12])
    step = SparseHessian(csc_array(hessian)).damped_step(gradient, np.array([0.5]))
    np.testing.assert_allclose(step[0], -np.linalg.solve(raised, gradient[0]), rtol=1e-9)
