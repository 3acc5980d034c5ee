"""Nearest rotations of many matrices at once, several times faster than by their singular values.

s, t, u are the singular values, with u below zero where the determinant d is. a = s^2 + t^2 + u^2 and b = (st)^2 +
(tu)^2 + (us)^2. The largest sum l = s + t + u is the largest root of (l^2 - a)^2 = 4 b + 8 d l. The rotation is then
((k + a) M + l cof(M) - M M' M) / (k l - d), with k = (l^2 - a) / 2. Source: Markley 1993 (fast optimal attitude
matrix).
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array
from basecal.geometry.rotation import nearest_rotation

_NEWTON_ROUNDS = 10  # of Newton's method from above, which converges quadratically unless two roots nearly meet
_CONVERGED_STEP = 1e-13  # relative, of the last step
_MANY_MATRICES = 100  # fewer are done by their singular values before the first round is
_LEAST_SEPARATION = 1e-3  # of l^3, of (s + t)(t + u)(u + s): below, rounding would show in the rotation


def nearest_rotations(matrix: Array) -> Array:
    """The rotations nearest in the Frobenius norm, (..., 3, 3), as `nearest_rotation` to 1e-12."""
    if matrix.size < 9 * _MANY_MATRICES:
        return nearest_rotation(matrix)
    rows = np.moveaxis(matrix, (-2, -1), (0, 1)).copy()
    cofactors = cross_rows(rows)
    determinant = dot(rows[0], cofactors[0])
    squares, products = (sum(dot(r, r) for r in of) for of in (rows, cofactors))
    with np.errstate(all="ignore"):
        largest = np.sqrt(3 * squares)
        for _ in range(_NEWTON_ROUNDS):
            off = largest * largest - squares
            step = (off * off - 4 * products - 8 * determinant * largest) / (4 * largest * off - 8 * determinant)
            largest = largest - step
        half = 0.5 * (largest * largest - squares)
        scale = half * largest - determinant
        clear = (np.abs(step) < _CONVERGED_STEP * largest) & (scale > _LEAST_SEPARATION * largest**3)
        of_rows = [[dot(r, other) for other in rows] for r in rows]
        found: Array = np.empty_like(matrix)
        for i in range(3):
            cubed = of_rows[i][0] * rows[0] + of_rows[i][1] * rows[1] + of_rows[i][2] * rows[2]
            row = ((half + squares) * rows[i] + largest * cofactors[i] - cubed) / scale
            found[..., i, :] = np.moveaxis(row, 0, -1)
    if not clear.all():
        found[~clear] = nearest_rotation(matrix[~clear])
    return found


def cross_rows(rows: Array) -> list[Array]:
    """Rows of the cofactor matrix of rows (3, 3, ...)."""
    return [_cross_product(rows[i - 2], rows[i - 1]) for i in range(3)]


def dot(first: Array, second: Array) -> Array:
    """Products of vectors (3, ...)."""
    total: Array = first[0] * second[0] + first[1] * second[1] + first[2] * second[2]
    return total


def _cross_product(first: Array, second: Array) -> Array:
    return np.stack([first[i - 2] * second[i - 1] - first[i - 1] * second[i - 2] for i in range(3)])
