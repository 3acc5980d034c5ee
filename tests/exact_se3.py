"""SE(3) by mpmath to fifty digits, and tangents at its hard points.

The tolerance at these points is 1e-12, for values of order 1. Double precision rounds at 2e-16. Closed forms begin at
0.5 rad, where the worst of them, (x^3 / 6 - x + sin x) / x^5, loses a factor of 0.5 / (0.5^5 / 120) = 2e3.
"""

import functools
import itertools

import mpmath
import numpy as np

DIGITS = 50
TOLERANCE = 1e-12
ANGLES = [0.0, 1e-12, 1e-9, 1e-6, 1e-5, 1e-3, 1e-1, 0.4999, 0.5001, 1.0, 3.0, np.pi - 1e-7]
AXES = {"x": (1, 0, 0), "-y": (0, -1, 0), "slanted": (0.48, -0.6, 0.64), "nearly z": (1e-8, 0, 1)}
SHIFTS = {"0": (0, 0, 0), "1m": (0.36, 0.48, 0.8)}
CASES = list(itertools.product(ANGLES, AXES, SHIFTS))
IDS = [f"{angle:g}-{axis}-{shift}" for angle, axis, shift in CASES]


def tangent(angle, axis, shift):
    direction = np.array(AXES[axis], dtype=float)
    return np.concatenate([SHIFTS[shift], angle * direction / np.linalg.norm(direction)])


def exact_hat(w):
    x, y, z = w
    return mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def exact_small_adjoint(xi):
    out = mpmath.zeros(6)
    out[0:3, 0:3] = out[3:6, 3:6] = exact_hat(xi[3:])
    out[0:3, 3:6] = exact_hat(xi[:3])
    return out


def power_series(matrix, first_factorial):
    """Sum of matrix^k / (k + first_factorial)! until the terms are gone."""
    size = matrix.rows
    term, total, k = mpmath.eye(size) / mpmath.factorial(first_factorial), mpmath.zeros(size), 0
    while mpmath.mnorm(term, 1) > mpmath.mpf(10) ** -DIGITS:
        total += term
        k += 1
        term = term * matrix / (k + first_factorial)
    return total


@functools.cache
def exact_exp(xi):
    """The matrix exponential, (4, 4) mpmath."""
    with mpmath.workdps(DIGITS):
        small = mpmath.zeros(4)
        small[0:3, 0:3] = exact_hat([mpmath.mpf(x) for x in xi[3:]])
        small[0:3, 3] = mpmath.matrix([mpmath.mpf(x) for x in xi[:3]])
        return power_series(small, 0)


@functools.cache
def exact_right_jacobian(xi):
    """Sum of (-ad)^k / (k + 1)!, (6, 6) mpmath."""
    with mpmath.workdps(DIGITS):
        return power_series(-exact_small_adjoint([mpmath.mpf(x) for x in xi]), 1)


def as_array(matrix):
    return np.array(matrix.tolist(), dtype=np.float64)
