"""Closed-form rotations and translations of A X B = Y C Z by Kronecker products.

Matrices are vectorised by columns: vec(P M Q) = kron(Q', P) vec(M). The null vector of a homogeneous system is accepted
only if the next singular value is clearly larger. Sources: Shah 2013, 10.1115/1.4024473 (two unknowns); Wang et al.
2022 (three unknowns); docs/mathematics.md (6.1)-(6.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.geometry import SE3, Array
from basecal.geometry.rotation import lengths, nearest_rotation
from basecal.numerics.spectral import least_norm, null_vector, principal_axes


class Loop(NamedTuple):
    """The six factors of A X B = Y C Z at n samples; an unknown X, Y or Z is None.

    A = eye_base_from_eye_flange, B = camera_from_target, C = hand_base_from_hand_flange, (n,) each;
    X = eye_flange_from_camera, Y = eye_base_from_hand_base, Z = hand_flange_from_target. weight: (n,).
    """

    a: SE3
    b: SE3
    c: SE3
    x: SE3 | None
    y: SE3 | None
    z: SE3 | None
    weight: Array

    @property
    def unknown(self) -> str:
        """Letters of the unknowns, such as "xz"."""
        return "".join(k for k in "xyz" if getattr(self, k) is None)


Triple = tuple[SE3, SE3, SE3]
"""X, Y and Z."""


class Rotations(NamedTuple):
    """Rotations of X, Y and Z, (3, 3) each, and whether the data determine the unknown ones uniquely."""

    x: Array
    y: Array
    z: Array
    clear: bool = True


def kron(left: Array, right: Array) -> Array:
    """Kronecker products over leading axes, (..., a, b) and (..., c, d) to (..., a c, b d)."""
    product = left[..., :, None, :, None] * right[..., None, :, None, :]
    shape = product.shape[:-4]
    return product.reshape(*shape, left.shape[-2] * right.shape[-2], left.shape[-1] * right.shape[-1])


def _unvec(vector: Array) -> Array:
    return vector.reshape(3, 3).T


def _solve_two(left: Array, right: Array, weight: Array) -> tuple[Array, Array, bool]:
    """Solve left vec(P) = right vec(Q), (n, 9, 9) each, for rotations P and Q, and whether they are unique."""
    rows = (np.concatenate([left, -right], -1) * weight[:, None, None]).reshape(-1, 18)
    null = null_vector(rows.T @ rows, float(lengths(weight)))
    vector = _choose_sign(null.vector, _unvec(null.vector[:9]))
    return nearest_rotation(_unvec(vector[:9])), nearest_rotation(_unvec(vector[9:])), null.unique


def _choose_sign(values: Array, matrix: Array) -> Array:
    """Choose the sign of values such that the determinant of a matrix among them is not negative."""
    return -values if np.linalg.det(matrix) < 0 else values


def solve_rotations(loop: Loop) -> Rotations:
    """Solve for the unknown rotations among X, Y and Z; known ones are returned unchanged."""
    identity = np.broadcast_to(np.eye(3), loop.a.rotation.shape)
    a, b, c, w = loop.a.rotation, loop.b.rotation, loop.c.rotation, loop.weight
    x, y, z = (None if t is None else t.rotation for t in (loop.x, loop.y, loop.z))
    if x is not None and y is not None:
        return Rotations(x, y, z if z is not None else mean_rotation((y @ c).mT @ a @ x @ b, w))
    if x is not None and z is not None:
        return Rotations(x, mean_rotation(a @ x @ b @ (c @ z).mT, w), z)
    if y is not None and z is not None:
        return Rotations(mean_rotation(a.mT @ y @ c @ z @ b.mT, w), y, z)
    if y is not None:
        p, q, clear = _solve_two(kron(b.mT, a), kron(identity, y @ c), w)
        return Rotations(p, y, q, clear)
    if z is not None:
        p, q, clear = _solve_two(kron(b.mT, a), kron((c @ z).mT, identity), w)
        return Rotations(p, q, z, clear)
    if x is not None:
        p, q, clear = _solve_two(kron((a @ x @ b).mT, identity), kron(identity, c), w)
        return Rotations(x, p.T, q, clear)
    return _solve_three(a, b, c, w)


def _solve_three(a: Array, b: Array, c: Array, weight: Array) -> Rotations:
    """Solve for X, Y and Z by K = kron(X', Y'): kron(vec(A)', kron(B', I)) vec(K) = kron(I, C) vec(Z)."""
    null = null_vector(_three_squares(a, b, c, weight), float(lengths(weight)))
    product = _choose_sign(null.vector, _unvec(null.vector[81:]))[:81].reshape(9, 9).T
    by_factor = product.reshape(3, 3, 3, 3).transpose(0, 2, 1, 3).reshape(9, 9)
    # The matrix has rank one up to noise: its factors are the first singular vectors, up to scale.
    of_y = principal_axes(by_factor).axes[:, 0]
    x_t, y_t = (by_factor @ of_y).reshape(3, 3), of_y.reshape(3, 3)
    x, y = nearest_rotation(_choose_sign(np.stack([x_t, y_t]), x_t)).mT
    return Rotations(x, y, mean_rotation((y @ c).mT @ a @ x @ b, weight), null.unique)


def _three_squares(a: Array, b: Array, c: Array, weight: Array) -> Array:
    """Normal matrix of the rows w [kron(vec(A)', kron(B', I)), -kron(I, C)], summed over samples, (90, 90).

    The block of the left part is kron(vec(A) vec(A)', I), the mixed block is -kron(vec(A), kron(B, C)).
    """
    n, squared_weight = len(a), weight**2
    vec_a = a.mT.reshape(n, 9)
    weighted = (squared_weight[:, None] * vec_a).T
    mixed = (weighted @ kron(b, c).reshape(n, 81)).reshape(81, 9)
    squares = np.zeros((90, 90))
    squares[:81, :81] = kron(weighted @ vec_a, np.eye(9))
    squares[:81, 81:], squares[81:, :81] = -mixed, -mixed.T
    np.einsum("ii->i", squares)[81:] = squared_weight.sum()
    return squares


def mean_rotation(matrices: Array, weight: Array) -> Array:
    """Chordal mean of rotations (n, 3, 3), weighted by the squares of (n,)."""
    return nearest_rotation(np.einsum("n,nij->ij", weight**2, matrices))


def solve_translations(loop: Loop, rotations: Rotations) -> Triple:
    """Solve for the unknown translations of X, Y and Z, given all rotations.

    Minimum-norm least squares of RA tX - tY - RY RC tZ = RY tC - tA - RA RX tB.
    """
    a, c = loop.a.rotation, loop.c.rotation
    right = loop.c.translation @ rotations.y.T - loop.a.translation
    right -= (a @ (loop.b.translation @ rotations.x.T)[..., None])[..., 0]
    columns = {"x": a, "y": np.broadcast_to(-np.eye(3), a.shape), "z": -(rotations.y @ c)}
    for name in "xyz":
        if name not in loop.unknown:
            right = right - (columns[name] @ getattr(loop, name).translation[:, None])[..., 0]
    unknown = loop.unknown
    weight = loop.weight[:, None, None]
    rows = np.concatenate([columns[name] for name in unknown], -1) * weight
    solution = least_norm(rows.reshape(-1, 3 * len(unknown)), (right * weight[..., 0]).reshape(-1))
    return complete_loop(loop, rotations, solution)


def complete_loop(loop: Loop, rotations: Rotations, translations: Array) -> Triple:
    """Assemble X, Y and Z from known transforms, rotations, and the translations of the k unknowns, (3 k,)."""
    by_letter = dict(zip(loop.unknown, translations.reshape(-1, 3), strict=True))
    x, y, z = (
        SE3.adopt(getattr(rotations, name).copy(), by_letter[name].copy()) if name in by_letter else getattr(loop, name)
        for name in "xyz"
    )
    return x, y, z
