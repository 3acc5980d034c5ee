"""Tests of gradient and information by moments, against explicit sums over points."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view.moments import UPPER, Monomials, dot, gradient_and_information
from basecal.geometry.rotation import cross_matrix, rotation_exp


def test_monomials_are_products_of_one_and_the_coordinates():
    """Products of 1, x, y and z appear once each, those with 1 first."""
    of = Monomials.from_points(np.array([[2.0, 3.0, 5.0]]))
    assert of.linear == 4
    assert of.values.tolist() == [[1, 2, 3, 5, 4, 6, 10, 9, 15, 25]]


def test_zero_monomials_are_left_out():
    """A plane has none with z, and a point at the origin only 1."""
    assert Monomials.from_points(np.array([[2.0, 3.0, 0.0], [0.0, 1.0, 0.0]])).values.tolist() == [
        [1, 2, 3, 4, 6, 9],
        [1, 0, 1, 0, 0, 1],
    ]
    assert Monomials.from_points(np.zeros((1, 3))).values.tolist() == [[1]]


def test_dot_is_the_sum_of_products():
    """Products are summed term by term, for one pair and for several, and the input is unchanged."""
    a, b = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    np.testing.assert_array_equal(dot([a], [b]), [3, 8])
    np.testing.assert_array_equal(dot([a, b, a], [b, b, a]), [3 + 9 + 1, 8 + 16 + 4])
    np.testing.assert_array_equal(a, [1, 2])


@pytest.mark.parametrize("extent", [(1, 1, 1), (1, 1, 0), (0, 1, 0), (0, 0, 0)], ids=str)
def test_moments_equal_sums_over_points(rng, extent):
    """J'r and J'J with J = P R [I, -hat(p)] are summed point by point, for a batch of two with three views each."""
    points, rotation = rng.standard_normal((5, 3)) * extent, rotation_exp(rng.standard_normal((2, 3, 3)))
    by_point, residual = rng.standard_normal((2, 3, 5, 2, 3)), rng.standard_normal((2, 3, 5, 2))
    forces = np.einsum("bnpki,bnpk->ibnp", by_point, residual)
    squares = [np.einsum("bnpk,bnpk->bnp", by_point[..., i], by_point[..., j]) for i, j in UPPER]
    motion = np.concatenate([np.broadcast_to(np.eye(3), (5, 3, 3)), -cross_matrix(points)], -1)
    jacobian = by_point @ rotation[:, :, None] @ motion
    gradient, information = gradient_and_information(forces, squares, rotation, Monomials.from_points(points))
    np.testing.assert_allclose(gradient, np.einsum("bnpki,bnpk->bni", jacobian, residual), atol=1e-12)
    np.testing.assert_allclose(information, np.einsum("bnpki,bnpkj->bnij", jacobian, jacobian), atol=1e-12)
