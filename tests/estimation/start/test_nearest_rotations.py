"""Nearest rotations of many matrices."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start import nearest_rotations as module
from basecal.estimation.start.nearest_rotations import nearest_rotations
from basecal.geometry.rotation import nearest_rotation, rotation_exp


@pytest.mark.parametrize("shape", [(7,), (40, 25)])
def test_they_are_those_of_singular_values(rng, shape):
    """Of any matrices, near rotations or reflections, few or many: to 1e-12."""
    matrix = rng.standard_normal((*shape, 3, 3))
    matrix[::3] = rotation_exp(rng.standard_normal((*matrix[::3].shape[:-2], 3))) * np.array([1.0, 1.0, -1.0])
    matrix[1::3] += 10 * np.eye(3)
    np.testing.assert_allclose(nearest_rotations(matrix), nearest_rotation(matrix), atol=1e-12)


def test_what_has_several_has_one_of_them(rng):
    """Zero, of rank one, and mirrored in any plane, among others: a rotation as near as any."""
    odd = [np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), -np.eye(3), np.diag([1.0, 1.0, -1.0]), np.ones((3, 3))]
    matrix = np.concatenate([np.stack(odd), rng.standard_normal((200, 3, 3))])
    found = nearest_rotations(matrix)
    np.testing.assert_allclose(found @ np.swapaxes(found, -1, -2), np.broadcast_to(np.eye(3), found.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found), 1.0, atol=1e-12)
    near, nearest = (np.einsum("nij,nij->n", matrix, of) for of in (found, nearest_rotation(matrix)))
    np.testing.assert_allclose(near, nearest, atol=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize(("count", "mirrored", "left"), [(99, 0, 99), (100, 0, 0), (150, 3, 3)])
def test_few_of_many_are_left_to_singular_values(rng, monkeypatch, count, mirrored, left, size):
    """Those that have several nearest rotations, or nearly; of less than a hundred all."""
    asked = []
    monkeypatch.setattr(module, "nearest_rotation", lambda of: asked.append(len(of)) or nearest_rotation(of))
    values = rng.uniform([1.5, 0.8, -0.4], [2.5, 1.2, 0.5], (count, 3))
    values[:mirrored] = np.array([[2.0, 1.0, -0.999], [2.0, 1.0, -1.0], [1.0, 0.0, 0.0]])[:mirrored]
    left_turn, right_turn = rotation_exp(rng.standard_normal((2, count, 3)))
    matrix = size * (left_turn * values[:, None]) @ right_turn
    np.testing.assert_allclose(nearest_rotations(matrix)[mirrored:], nearest_rotation(matrix)[mirrored:], atol=1e-11)
    assert asked == [left] * (left > 0)
