"""Gradient and information of views from moments of the target's points, without a Jacobian of each point.

The Jacobian of the residual of a point p is J = P R [I, -hat(p)]. P is the derivative with respect to the point in the
camera, R the rotation of `camera_from_target`, and hat(p) the cross-product matrix of p. J'J is therefore linear in
R'P'PR and quadratic in h = (1, x, y, z) of the point. J'r is linear in both R'P'r and h. Only the sums over points of
(P'P)_ij h_a h_b and (P'r)_i h_a are needed.
These are products with matrices that depend on the target alone; the rotation is applied once per view.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement, product

import numpy as np

from basecal.geometry import Array

# Cache size: targets of one calibration, whole and thinned; assumed: a larger cache only costs memory.
_CACHED_TARGETS = 32
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_MONOMIALS = tuple(combinations_with_replacement(range(4), 2))
_FIRST, _SECOND = np.array(_MONOMIALS).T


@dataclass(frozen=True, eq=False)
class Monomials:
    """Non-zero products of 1, x, y and z of a target's points. Four of the ten are zero for a plane board.

    Attributes:
        values: (p, k) products; the first `linear` columns are 1 and the non-zero coordinates.
        linear: Number of the constant and linear columns.
        to_gradient: (3 linear, 6) matrix from sums of (R'P'r)_i h_a over points to J'r.
        to_information: (6 k, 36) matrix from sums of (R'P'PR)_ij h_a h_b, upper halves, to J'J.
    """

    values: Array
    linear: int
    to_gradient: Array
    to_information: Array

    @classmethod
    def from_points(cls, points: Array) -> Monomials:
        """Make the monomials of points, (p, 3); results are cached."""
        return _monomials(points.tobytes())

    @classmethod
    def _from_points(cls, points: Array) -> Monomials:
        h = np.column_stack([np.ones(len(points)), points])
        values = h[:, _FIRST] * h[:, _SECOND]
        kept = np.flatnonzero(values.any(0))
        linear = int(np.count_nonzero(kept < len(_TO_GRADIENT)))
        to_gradient = _TO_GRADIENT[kept[:linear]].swapaxes(0, 1).reshape(3 * linear, 6)
        return cls(values[:, kept], linear, to_gradient, _TO_INFORMATION[:, kept].reshape(6 * len(kept), 36))


@lru_cache(maxsize=_CACHED_TARGETS)
def _monomials(points: bytes) -> Monomials:
    return Monomials._from_points(np.frombuffer(points).reshape(-1, 3))


def dot(left: Sequence[Array], right: Sequence[Array]) -> Array:
    """Sum of products, term by term."""
    total = left[0] * right[0]
    for a, b in zip(left[1:], right[1:], strict=True):
        total += a * b
    return total


def gradient_and_information(
    forces: Iterable[Array], squares: Iterable[Array], rotation: Array, monomials: Monomials
) -> tuple[Array, Array]:
    """J'r, (..., 6), and J'J, (..., 6, 6), of views.

    Args:
        forces: P'r, three arrays (..., p), or one (3, ..., p).
        squares: The upper half of P'P by rows, six arrays (..., p), or one (6, ..., p), see `UPPER`.
        rotation: Rotation of camera_from_target, (..., 3, 3).
        monomials: Monomials of the points.
    """
    shape, flat = rotation.shape[:-2], rotation.reshape(-1, 3, 3)
    first_moments = flat.mT @ _moments(forces, monomials.values[:, : monomials.linear])
    # Matrices that map the upper half of a symmetric M to the upper half of R'MR, (n, 6, 6).
    entries = flat.reshape(len(flat), 9)
    congruences = entries[:, _LEFT] * entries[:, _RIGHT]
    congruences += entries[:, _LEFT_SWAPPED] * entries[:, _RIGHT_SWAPPED]
    congruences *= _SYMMETRY_WEIGHTS
    second_moments = congruences.reshape(len(flat), 6, 6) @ _moments(squares, monomials.values)
    gradient = first_moments.reshape(len(flat), len(monomials.to_gradient)) @ monomials.to_gradient
    information = second_moments.reshape(len(flat), len(monomials.to_information)) @ monomials.to_information
    return gradient.reshape(*shape, 6), information.reshape(*shape, 6, 6)


def _moments(planes: Iterable[Array], monomials: Array) -> Array:
    """Sums over points of k arrays (..., p), n views in all, times (p, m): (n, k, m).

    For few views, one array and one product are fastest. For many views, planes that are made and used one after
    another are faster.
    """
    if isinstance(planes, np.ndarray):
        return np.asarray((planes.reshape(len(planes), -1, len(monomials)) @ monomials).swapaxes(0, 1))
    return np.stack([plane.reshape(-1, len(monomials)) @ monomials for plane in planes], 1)


def _tangent_coefficients() -> Array:
    """Coefficients (4, 3, 6) of [I, -hat(p)], the derivative of a point with respect to the tangent, in h."""
    out = np.zeros((4, 3, 6))
    out[0, :, :3] = np.eye(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[1 + i, j, 3 + k], out[1 + i, k, 3 + j] = 1.0, -1.0
    return out


def _to_information() -> Array:
    """Tensor (6, 10, 36) that maps the upper halves of (R'P'PR)_ij h_a h_b to J'J."""
    out = np.zeros((len(UPPER), len(_MONOMIALS), 6, 6))
    for row, (i, j) in enumerate(UPPER):
        for column, (a, b) in enumerate(_MONOMIALS):
            for (m, n), (left, right) in product({(i, j), (j, i)}, {(a, b), (b, a)}):
                out[row, column] += np.outer(_TO_GRADIENT[left, m], _TO_GRADIENT[right, n])
    return out.reshape(len(UPPER), len(_MONOMIALS), 36)


_TO_GRADIENT = _tangent_coefficients()
_TO_INFORMATION = _to_information()
# (R'MR)_ij is the sum of M_ab R_ai R_bj and, off the diagonal, M_ab R_bi R_aj.
_TERMS = [(i, j, a, b) for i, j in UPPER for a, b in UPPER]
_LEFT, _RIGHT = np.array([(3 * a + i, 3 * b + j) for i, j, a, b in _TERMS]).T
_LEFT_SWAPPED, _RIGHT_SWAPPED = np.array([(3 * b + i, 3 * a + j) for i, j, a, b in _TERMS]).T
_SYMMETRY_WEIGHTS = np.array([0.5 if a == b else 1.0 for _, _, a, b in _TERMS])
