"""Tests of separating information from rounding in matrices."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.geometry import SE3
from basecal.numerics.spectral import (
    ROUNDING,
    VIEW_ROUNDING,
    Spectrum,
    dimension,
    floored_inverse,
    floored_spectrum,
    holds_information,
    inverse_beside_identity,
    least_norm,
    null_vector,
    principal_axes,
    pseudo_inverse,
    scaled_spectrum,
    smallest_vectors,
    sort_by_share,
    spectrum,
)

UNITS = np.array([1e-4, 1.0, 1e3, 1e6, 1e-2])


def information(rng: np.random.Generator, rank: int, units: np.ndarray = UNITS) -> np.ndarray:
    rows = rng.standard_normal((40, rank)) @ rng.standard_normal((rank, len(units))) * units
    return rows.T @ rows


@pytest.mark.parametrize("rank", range(1, 6))
def test_rank_is_independent_of_units(rng, rank):
    """Information of any rank has that rank, with unknowns in units ten orders of magnitude apart."""
    assert spectrum(information(rng, rank)).rank == rank


@pytest.mark.parametrize("rank", [2, 5])
def test_root_and_inverse_of_the_matrix(rng, rank):
    """The root squared is the matrix, the inverse root squared the inverse.

    Both vanish along unobservable directions.
    """
    matrix = information(rng, rank)
    of = spectrum(matrix)
    back = np.outer(UNITS, UNITS)
    np.testing.assert_allclose((of.root @ of.root.T) / back, matrix / back, atol=1e-9)
    np.testing.assert_allclose(matrix @ of.inverse @ matrix / back, matrix / back, atol=1e-6)
    assert np.count_nonzero(of.root.any(0)) == np.count_nonzero(of.inverse_root.any(0)) == rank


def test_spectrum_of_a_batch_equals_separate_spectra(rng):
    """Ranks and inverses of matrices in a batch equal those of each alone, a zero matrix included."""
    matrices = np.stack([information(rng, 3), np.zeros((5, 5)), information(rng, 5)])
    together = spectrum(matrices)
    assert together.rank.tolist() == [3, 0, 5]
    assert not together.inverse[1].any()
    np.testing.assert_allclose(together.inverse[2], spectrum(matrices[2]).inverse, rtol=1e-9)


def test_empty_matrix_has_rank_zero():
    """A matrix without rows has rank zero and an inverse without rows."""
    assert spectrum(np.zeros((0, 0))).rank == 0
    assert spectrum(np.zeros((0, 0))).inverse.shape == (0, 0)


def test_rounding_threshold_is_relative_to_the_largest():
    """Eigenvalues just below the threshold are rounding, those just above it information."""
    values = np.array([0.5 * ROUNDING, 2 * ROUNDING, 1.0]) * 7
    assert holds_information(values).tolist() == [False, True, True]


def test_rounding_of_sums_stays_below_the_threshold(rng):
    """Null directions of products of 3,000 rows stay below a tenth of the threshold, and full ranks do not vanish."""
    rows = rng.standard_normal((3000, 20)) @ rng.standard_normal((20, 30))
    values = np.abs(spectrum(rows.T @ rows).values)
    assert values[9] < 0.1 * ROUNDING * values[-1]
    assert values[10] > 1e3 * ROUNDING * values[-1]


@pytest.mark.parametrize("away", [0.0, 2.0])
def test_rounding_of_a_view_stays_below_the_threshold(rng, away):
    """Two points determine four degrees of freedom of a pose, also if the target's origin is ten targets away."""
    points = rng.uniform(-0.1, 0.1, (2, 3)) + away
    poses = SE3.from_rotvec(rng.uniform(-1, 1, (50, 3)), rng.uniform(-0.2, 0.2, (50, 3)) + np.array([0, 0, 1.0]))
    poses = poses @ SE3(np.eye(3), -points.mean(0))
    seen = poses.rotation @ points.T + poses.translation[..., None]
    bearings = np.swapaxes(seen / np.linalg.norm(seen, axis=1, keepdims=True), 1, 2)
    view = BearingMeasurement(points, bearings, np.full((50, 2), 1e3)).linearise(poses, None, False)
    assert spectrum(view.information, VIEW_ROUNDING).rank.tolist() == [4] * 50


def test_least_norm_solution_of_rank_deficient_rows(rng):
    """Among the solutions of rank-deficient rows, the one orthogonal to their null space is returned."""
    rows = rng.standard_normal((10, 2)) @ rng.standard_normal((2, 4))
    right = rows @ rng.standard_normal(4)
    found = least_norm(rows, right)
    np.testing.assert_allclose(rows @ found, right, atol=1e-9)
    np.testing.assert_allclose(np.linalg.svd(rows)[2][2:] @ found, 0, atol=1e-9)


@pytest.mark.parametrize("spans", range(4))
def test_dimension_of_points_far_from_the_origin(rng, spans):
    """Points span the space they were drawn in, without the rounding of their distant position."""
    points = rng.standard_normal((8, spans)) @ rng.standard_normal((spans, 3)) * 0.1 + 3.0
    assert dimension(points if spans else np.full((8, 3), 3.0)) == spans


def test_half_micrometre_per_metre_is_planar():
    """A board of 1 m with corners 0.5 um off its plane is planar, one with 10 um is not."""
    board = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1.0]])
    assert dimension(board * [1, 1, 5e-7]) == 2
    assert dimension(board * [1, 1, 1e-5]) == 3


def test_mahalanobis_uses_the_pseudo_inverse(rng):
    """Vectors of a batch are weighted by the inverse along observable directions and by zero along the others."""
    matrices = np.stack([information(rng, 3), information(rng, 5)])
    vectors = rng.standard_normal((2, 5)) * UNITS
    of = spectrum(matrices)
    np.testing.assert_allclose(
        of.squared_mahalanobis(vectors), np.einsum("bi,bij,bj->b", vectors, of.inverse, vectors), rtol=1e-9
    )
    hidden = of.scale[0] * of.vectors[0, :, 0]
    assert of.squared_mahalanobis(np.stack([hidden, hidden]))[0] < 1e-9
    np.testing.assert_allclose(
        of.squared_mahalanobis(vectors)[1], vectors[1] @ np.linalg.solve(matrices[1], vectors[1])
    )


def test_inverse_with_ridge_is_that_of_the_sum(rng):
    """The inverse is finite if one of the two is 1e20 times the other, and covers observable directions only."""
    root = rng.standard_normal((4, 3, 3))
    matrix = root @ root.mT
    np.testing.assert_allclose(
        spectrum(matrix).inverse_with_ridge(0.5), np.linalg.inv(matrix + 0.5 * np.eye(3)), rtol=1e-9
    )
    for size in (1e-20, 1e20):
        found = spectrum(size * matrix).inverse_with_ridge(1.0)
        want = np.tile(np.eye(3), (4, 1, 1)) if size < 1 else np.linalg.inv(size * matrix)
        np.testing.assert_allclose(found, want, rtol=1e-6, atol=1e-6 * np.abs(want).max())
    assert spectrum(np.diag([1.0, 0.0])).inverse_with_ridge(1.0).tolist() == [[0.5, 0.0], [0.0, 0.0]]
    assert spectrum(np.zeros((5, 0, 0))).inverse_with_ridge(1.0).shape == (5, 0, 0)


def test_log_det_of_observable_directions():
    """A regular matrix has the logarithm of its determinant, and unknowns without information do not count."""
    matrix = np.array([[4.0, 1.0], [1.0, 9.0]])
    np.testing.assert_allclose(spectrum(matrix).log_det, np.log(35.0))
    without = np.zeros((3, 3))
    without[:2, :2] = matrix
    np.testing.assert_allclose(spectrum(without).log_det, np.log(35.0))


def test_scaled_spectrum_uses_stated_units():
    """Eigenvalues divide at `least` in stated units, whatever the diagonal, and never below rounding of the largest."""
    matrix = np.diag([0.3, 0.5, 2.0])
    assert scaled_spectrum(matrix, 0.4).is_informative.tolist() == [False, True, True]
    assert scaled_spectrum(matrix, 0.4, np.array([0.5, 1.0, 3.0])).rank == 2  # 1.2, 0.5, 0.222
    assert scaled_spectrum(np.diag([1.0, 1e13]), 0.1).is_informative.tolist() == [False, True]
    assert scaled_spectrum(np.diag([20.0, 1e13]), 0.1).is_informative.tolist() == [True, True]
    np.testing.assert_allclose(scaled_spectrum(matrix, 0.4).inverse, np.diag([0, 2.0, 0.5]))
    assert scaled_spectrum(np.zeros((2, 0, 0)), 0.1).rank.tolist() == [0, 0]


def test_floored_spectrum_raises_small_eigenvalues():
    """A saddle becomes regular, and its inverse is that of the raised eigenvalues."""
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    of = floored_spectrum(turn @ np.diag([-3.0, 5.0]) @ turn.T, 0.5)
    np.testing.assert_allclose(of.inverse, turn @ np.diag([2.0, 0.2]) @ turn.T)
    np.testing.assert_allclose(of.log_det, np.log(2.5))


@pytest.mark.parametrize(("left", "unique"), [(0.3, True), (0.4, False)])
def test_null_vector_is_unique_with_a_gap(left, unique):
    """The vector is that of the smallest singular value, and is unique if the next value is larger by the gap."""
    found = null_vector((np.diag([1.0, left, 3.0]) * 7) ** 2, 7.0)
    np.testing.assert_allclose(np.abs(found.vector), [0, 1, 0], atol=1e-12)
    assert found.unique is unique


def test_two_null_vectors_are_not_unique():
    """If two directions are unconstrained, neither is the null vector, whichever rounding prefers."""
    assert not null_vector(np.diag([1e-9, 5e-4, 1.0]) ** 2, 1.0).unique
    assert null_vector(np.diag([1e-9, 2e-3, 1.0]) ** 2, 1.0).unique


def test_basis_is_sorted_by_share_of_rows(rng):
    """Columns are sorted by their share of the rows, span the same space, and stay orthonormal."""
    basis = np.linalg.qr(rng.standard_normal((6, 4)))[0]
    turned = sort_by_share(basis, np.array([0, 5]))
    np.testing.assert_allclose(turned.basis.T @ turned.basis, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(basis @ (basis.T @ turned.basis), turned.basis, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turned.basis[[0, 5]], axis=0), turned.share, atol=1e-12)
    assert turned.share[0] >= turned.share[1] > 0
    assert not turned.share[2:].any()


def test_basis_without_requested_rows_is_unchanged(rng):
    """If no row is requested, the basis is unchanged, and an empty basis has no shares."""
    basis = np.linalg.qr(rng.standard_normal((6, 2)))[0]
    untouched = sort_by_share(basis, np.zeros(0, dtype=np.int64))
    assert untouched.basis is basis
    assert untouched.share.tolist() == [0, 0]
    assert sort_by_share(basis[:, :0], np.array([1])).share.shape == (0,)


def test_principal_axes_and_extents():
    """Extents decrease, and their axes are the columns.

    Extents up to the relative threshold do not count for the dimension.
    """
    vectors = np.array([[0, 3.0, 0], [0, -3.0, 0], [2.0, 0, 0]])
    of = principal_axes(vectors)
    np.testing.assert_allclose(np.abs(of.axes[:, :2]), [[0, 1], [1, 0], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(of.extents, [np.sqrt(18), 2.0, 0], atol=1e-12)
    assert of.dimension == 2
    assert principal_axes(vectors, 0.5).dimension == 1
    assert principal_axes(np.zeros((0, 3))).dimension == 0
    assert principal_axes(vectors[:1]).axes.shape == (3, 3)


def test_pseudo_inverse_ignores_rounding(rng):
    """Rows that differ by rounding count once."""
    row = rng.standard_normal(3)
    inverse = pseudo_inverse(np.stack([row, row * (1 + 1e-13)]))
    np.testing.assert_allclose(inverse.sum(1), row / (row @ row), rtol=1e-9)


def test_ridge_fades_out_weak_directions():
    """Directions far above the ridge count fully, those far below it not at all, and one of its size by half."""
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((4, 4)))[0]
    of = Spectrum(np.array([1e-15, 1e-9, 1e-3, 1.0]), turn, np.ones(4), np.array([False, False, True, True]))
    ridged = of.add_ridge(1e-9)
    np.testing.assert_allclose(of.values / ridged.values, [1e-6, 0.5, 1.0, 1.0], atol=2e-6)
    larger = Spectrum(100 * of.values, turn, np.ones(4), of.is_informative)
    np.testing.assert_allclose(larger.add_ridge(1e-9).values, 100 * ridged.values)
    nothing = Spectrum(np.array([-1e-20, 0.0, 0.0, 0.0]), turn, np.ones(4), of.is_informative).add_ridge(1e-9)
    assert np.all(nothing.values > 0)
    along = turn @ np.array([1e-9, 1e-5, 0.1, 2.0])
    assert ridged.squared_mahalanobis(along) == pytest.approx(1e-9 + 1e-10 / 2e-9 + 10.0 + 4.0, rel=1e-5)


def test_smallest_vectors_equal_the_decomposition(rng):
    """Vectors of many matrices are correct whether the smallest eigenvalue is rounding, noise, or exactly zero."""
    basis = np.linalg.qr(rng.standard_normal((5, 9, 9)))[0]
    for least, exact in ((0.0, 1e-13), (1e-6, 1e-13), (0.09, 1e-9)):
        values = np.append(least, rng.uniform(1, 4, 8))
        found = smallest_vectors((basis * values) @ basis.mT)
        along = np.einsum("nk,nk->n", found, basis[..., 0])
        np.testing.assert_allclose(found * np.sign(along)[:, None], basis[..., 0], atol=exact)
    np.testing.assert_allclose(np.linalg.norm(smallest_vectors(np.zeros((2, 4, 4))), axis=-1), 1)


def test_floored_inverse_is_that_of_the_floored_matrix(rng):
    """The inverse is correct for regular and singular matrices, and for a batch with both."""
    basis = np.linalg.qr(rng.standard_normal((2, 4, 4)))[0]
    regular = (basis * [1.0, 2.0, 3.0, 4.0]) @ basis.mT
    singular = (basis * [-1e-12, 0.0, 3.0, 4.0]) @ basis.mT
    for matrix in (regular, singular, np.concatenate([regular, singular])):
        np.testing.assert_allclose(
            floored_inverse(matrix, 1e-3), floored_spectrum(matrix, 1e-3).inverse, rtol=1e-9, atol=1e-9
        )


def test_floored_inverse_at_rounding_has_positive_eigenvalues():
    """A matrix whose smallest eigenvalue is rounding of the largest has a positive definite inverse.

    Cholesky accepts it, and its plain inverse is indefinite.
    """
    basis = np.linalg.qr(np.random.default_rng(5).standard_normal((200, 6, 6)))[0]
    matrix = (basis * [1e-7, 1e6, 1e7, 1e9, 5e9, 1e10]) @ basis.mT
    matrix = 0.5 * (matrix + matrix.mT)
    assert np.linalg.eigvalsh(floored_inverse(matrix, 1e-15)).min() > 0


def test_inverse_beside_a_tiny_identity_is_regular(rng):
    """For a matrix of rank 2 with 1 at a millionth of its rounding, all eigenvalues are from 0 to 1."""
    rows = 1e11 * rng.standard_normal((2, 4))
    values = np.linalg.eigvalsh(inverse_beside_identity(rows.T @ rows))
    assert values.min() > -1e-9
    assert values.max() < 1 + 1e-9


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_inverse_beside_identity_keeps_the_null_space(rng, size):
    """Null directions of a matrix of rank 2 keep the identity's 1. The others are 1 / (1 + eigenvalue)."""
    basis = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    found = inverse_beside_identity((basis * [0.0, 0.0, size, 2 * size]) @ basis.T)
    wanted = (basis * [1.0, 1.0, 1 / (1 + size), 1 / (1 + 2 * size)]) @ basis.T
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_scaled_spectrum_removes_units(rng):
    """A full matrix in units ten orders apart has the eigenvalues and inverse of the same matrix without units."""
    rows = rng.standard_normal((9, 5))
    plain = rows.T @ rows
    of = scaled_spectrum(plain * np.outer(UNITS, UNITS), 0.1, UNITS)
    np.testing.assert_allclose(of.values, np.linalg.eigvalsh(plain), rtol=1e-9)
    np.testing.assert_allclose(of.inverse * np.outer(UNITS, UNITS), np.linalg.inv(plain), rtol=1e-7)


@pytest.mark.parametrize("smallest", [2e-9, 5e-10])
def test_relative_threshold_of_exact_columns(smallest):
    """Singular values below 1e-9 of the largest are rounding, in pseudo-inverses and in least squares."""
    values = np.array([2.0, 1.0, 2 * smallest])
    left = np.divide(1, values, out=np.zeros(3), where=values > 2e-9)
    np.testing.assert_allclose(pseudo_inverse(np.diag(values)), np.diag(left), rtol=1e-9)
    np.testing.assert_allclose(least_norm(np.diag(values), np.ones(3)), left, rtol=1e-9)


def test_smallest_vectors_suppress_the_next_by_sixteenth_power():
    """For eigenvalues of 1 and 2, rotated by 30 deg, 2^-16 of the next vector remains.

    Its share depends on the larger column's part of both.
    """
    turn = np.array([[np.sqrt(3) / 2, -0.5], [0.5, np.sqrt(3) / 2]])
    found = smallest_vectors((turn @ np.diag([1.0, 2.0]) @ turn.T)[None])[0]
    along, across = turn.T @ found
    assert across / along == pytest.approx(-(2.0**-16) / np.sqrt(3), rel=1e-6)


@pytest.mark.parametrize("shape", [(0, 0), (4, 0, 0), (0, 3, 3)])
def test_spectra_of_empty_matrices_and_batches(shape):
    """Empty matrices and empty batches have spectra of matching shapes."""
    for of in (
        spectrum(np.zeros(shape)),
        scaled_spectrum(np.zeros(shape), 1.0),
        scaled_spectrum(np.zeros(shape), 1.0, np.ones(shape[:-1])),
    ):
        assert of.values.shape == of.scale.shape == of.is_informative.shape == shape[:-1]
        assert of.inverse.shape == of.vectors.shape == shape
        assert of.rank.shape == shape[:-2]
        assert not of.rank.any()


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_diagonal_is_the_unit_of_each_row(unit):
    """Units follow the diagonal however small or large it is, and a zero row has a unit of one."""
    of = spectrum(np.array([[4.0 * unit, unit, 0.0], [unit, 9e-6 * unit + unit, 0.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(of.scale, [2 * unit**0.5, ((1 + 9e-6) * unit) ** 0.5, 1.0])
    assert of.values[-1] == pytest.approx(1 + 0.5 / (1 + 9e-6) ** 0.5)
    assert of.rank == 2


@pytest.mark.parametrize(("first", "second", "size", "unique"), [
    (3.4, 10.0, 100.0, True), (3.6, 10.0, 100.0, False),  # the limit is a third of the next
    (0.0, 10.0, 9e3, True), (0.0, 10.0, 1.1e4, False),  # the next has to exceed a thousandth of the rows' size
    (0.034, 0.1, 1.0, True), (0.036, 0.1, 1.0, False),
])  # fmt: skip
def test_null_vector_needs_a_gap(first, second, size, unique):
    """The smallest singular value has to be below a third of the next.

    The next has to exceed a thousandth of the rows' size.
    """
    found = null_vector(np.diag(np.square([50.0, second, first])), size)
    assert found.unique == unique
    np.testing.assert_allclose(np.abs(found.vector), [0, 0, 1], atol=1e-9)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_extent_below_a_millionth_of_the_largest_is_zero(unit):
    """The dimension is correct for points a millimetre or a kilometre apart, and is zero without points."""
    plane = unit * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    for depth, spans in ((1e-7, 2), (1e-5, 3)):
        raised = plane.copy()
        raised[3, 2] = unit * depth
        assert dimension(raised) == spans
    assert dimension(np.zeros((0, 3))) == 0


def test_smallest_vectors_with_any_leading_axes(rng):
    """A single matrix and a grid have the same vectors, whatever their sizes. A zero matrix has a unit vector."""
    basis = np.linalg.qr(rng.standard_normal((3, 2, 5, 5)))[0]
    matrices = (basis * [0.0, 1.0, 2.0, 3.0, 4.0]) @ basis.mT * np.geomspace(1e-6, 1e6, 6).reshape(3, 2, 1, 1)
    grid = smallest_vectors(matrices)
    np.testing.assert_allclose(np.abs(np.vecdot(grid, basis[..., 0])), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(smallest_vectors(matrices[1, 1]) @ basis[1, 1, :, 0]), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(smallest_vectors(np.zeros((3, 3)))), 1.0)
