"""Rigid transforms, batched over leading axes.

`a_from_b @ b_from_c` composes, `a_from_b @ p_in_b` moves points. Tangents are (translation [m], rotation [rad]) and
perturb on the right: `a_from_b @ SE3.exp(xi)`, so `xi` is in the axes of b. Source: Sola et al. 2018,
arXiv:1812.01537.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike

from basecal.errors import InputError, check_type
from basecal.geometry.array import Array, ReadOnlyArrays, entry_clause, read_only, with_last_axis
from basecal.geometry.euler import rpy_of_rotation
from basecal.geometry.rotation import (
    ROTATION_TOLERANCE,
    check_rotation,
    cross_matrix,
    exp_coefficients,
    lengths,
    project_rotation,
    quaternion_from_rotation,
    rotation_exp,
    rotation_from_quaternion,
    rotation_log,
    with_identity,
)


def _product(left: Array, right: Array) -> Array:
    """Products of matrices; a batch times a single matrix is one large product, which is five times as fast."""
    if right.ndim == 2 and left.ndim > 2:
        return (left.reshape(-1, 3) @ right).reshape(left.shape)
    if right.ndim > 2 and right.shape[-3] == 1 and left.ndim > 2:
        *batch, count, _, _ = left.shape
        stacked: Array = left.reshape(*batch, 3 * count, 3) @ right[..., 0, :, :]
        return stacked.reshape(*stacked.shape[:-2], count, 3, 3)
    if left.ndim > 2 and left.shape[-3] == 1 and right.ndim > 2:
        *batch, count, _, _ = right.shape
        stacked_columns = left[..., 0, :, :] @ np.swapaxes(right, -3, -2).reshape(*batch, 3, 3 * count)
        return np.swapaxes(stacked_columns.reshape(*stacked_columns.shape[:-1], count, 3), -3, -2)
    product: Array = left @ right
    return product


def _rotate(rotation: Array, vectors: Array) -> Array:
    """Rotate vectors; a single rotation of a batch of vectors is one large product."""
    if rotation.ndim == 2:
        return np.asarray(vectors @ rotation.T, dtype=np.float64)
    if rotation.shape[-3] == 1 and vectors.ndim > 1:
        return np.asarray(vectors @ rotation[..., 0, :, :].mT, dtype=np.float64)
    rotated: Array = (rotation @ vectors[..., None])[..., 0]
    return rotated


@dataclass(frozen=True, eq=False, init=False)
class SE3(ReadOnlyArrays):
    """A rigid transform, or a batch of transforms.

    The arrays are read-only copies of the arguments.

    Attributes:
        rotation: (..., 3, 3) rotation matrices.
        translation: (..., 3) [m], with the same leading axes as the rotation.

    Raises:
        InputError: if the shapes are wrong, or a finite matrix is not a rotation.
    """

    rotation: Array
    translation: Array
    __array_ufunc__: ClassVar[None] = None  # an array @ a transform is a TypeError, not an array of objects

    def __init__(self, rotation: ArrayLike, translation: ArrayLike) -> None:
        rotation = read_only(rotation, (3, 3), "rotation")
        translation = read_only(translation, (3,), "translation")
        if rotation.shape[:-1] != translation.shape:
            raise InputError(
                f"rotation has shape {rotation.shape} and translation {translation.shape}, "
                "expected (..., 3, 3) and (..., 3) with the same leading axes"
            )
        check_rotation(rotation)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def adopt(cls, rotation: Array, translation: Array) -> SE3:
        """Make a transform of arrays (..., 3, 3) and (..., 3) [m] without a copy; they become read-only.

        Nothing is copied or checked, which takes a third of the time. Use it for new arrays without other references.
        """
        rotation.setflags(write=False)
        translation.setflags(write=False)
        transform = object.__new__(cls)
        transform.__dict__.update(rotation=rotation, translation=translation)
        return transform

    @classmethod
    def identity(cls, shape: tuple[int, ...] = ()) -> SE3:
        """Identity transforms, a batch of `shape`."""
        return cls.adopt(np.broadcast_to(np.eye(3), (*shape, 3, 3)).copy(), np.zeros((*shape, 3)))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, name: str = "matrix") -> SE3:
        """Make poses from homogeneous matrices, (..., 4, 4).

        A rotation part within 1e-3 of a rotation is projected onto the nearest one.

        Raises:
            InputError: if a value is not finite, the last row is not (0, 0, 0, 1), or the upper left is not a rotation.
        """
        m = read_only(matrix, (4, 4), name)
        if np.any(is_wrong := ~np.isfinite(m).all((-2, -1))):
            raise InputError(f"{name} holds NaN or infinity{entry_clause(is_wrong)}")
        if not np.allclose(m[..., 3, :], (0, 0, 0, 1), atol=1e-6):
            by_columns = np.allclose(m[..., :, 3], (0, 0, 0, 1), atol=1e-6)
            hint = ", but the last column is: it looks transposed, write matrices by rows" if by_columns else ""
            raise InputError(f"{name}: the last row is not (0, 0, 0, 1){hint}")
        return cls.adopt(project_rotation(m[..., :3, :3], name), m[..., :3, 3].copy())

    @classmethod
    def from_quaternion(cls, q_xyzw: ArrayLike, translation: ArrayLike, name: str = "q_xyzw") -> SE3:
        """Make poses from quaternions (x, y, z, w), (..., 4), of norm 1 within 1e-3, and translations (..., 3) [m].

        Raises:
            InputError: if a shape is wrong, a value is not finite, or a norm differs from 1 by more.
        """
        q, t = read_only(q_xyzw, name=name), read_only(translation, name="translation")
        if q.shape[-1:] != (4,) or t.shape[-1:] != (3,):
            raise InputError(f"{name} needs 4 numbers and a translation 3, got {q.shape} and {t.shape}")
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(t))):
            raise InputError(f"{name} or its translation holds NaN or infinity")
        norm = np.linalg.norm(q, axis=-1)
        if np.any(np.abs(norm - 1) > ROTATION_TOLERANCE):
            worst = float(norm.flat[np.argmax(np.abs(norm - 1))])
            raise InputError(f"{name} has norm {worst:.6g}, expected 1 within {ROTATION_TOLERANCE:g}")
        return cls(rotation_from_quaternion(q / norm[..., None]), t)

    @classmethod
    def from_rotvec(cls, rotvec: ArrayLike, translation: ArrayLike) -> SE3:
        """Make poses from rotation vectors, (..., 3) [rad], and translations, (..., 3) [m]."""
        return cls(rotation_exp(read_only(rotvec, (3,), "rotvec")), translation)

    @classmethod
    def from_rpy(cls, rpy: ArrayLike, translation: ArrayLike) -> SE3:
        """Make poses from angles about the fixed axes x, then y, then z, (..., 3) [rad], as in a URDF `origin`."""
        r, p, y = np.moveaxis(read_only(rpy, (3,), "rpy"), -1, 0)
        axes = np.eye(3)
        rotation = (rotation_exp(y[..., None] * axes[2]) @ rotation_exp(p[..., None] * axes[1])) @ rotation_exp(
            r[..., None] * axes[0]
        )
        return cls(rotation, translation)

    @classmethod
    def exp(cls, xi: ArrayLike) -> SE3:
        """Make poses from tangents, (..., 6) [m, rad]."""
        x = with_last_axis(xi, 6, "xi")
        v, w = x[..., :3], x[..., 3:]
        a, b, c = exp_coefficients(lengths(w))[..., None, None]
        cross, column = cross_matrix(w), x[..., :3, None]
        square = cross @ cross
        product = c * (square @ column)
        product += b * (cross @ column)
        translation = v + product[..., 0]
        square *= b
        cross *= a
        square += cross
        return cls.adopt(with_identity(square, np.ones(square.shape[:-2])), translation)

    @classmethod
    def stack(cls, transforms: Sequence[SE3]) -> SE3:
        """Stack transforms of equal shapes along a new first axis.

        Raises:
            InputError: if an entry is not a transform, or shapes differ.
        """
        if not len(transforms):
            return cls.identity((0,))
        for transform in transforms:
            check_type("each of the transforms", transform, SE3)
        if len({transform.shape for transform in transforms}) > 1:
            shapes = ", ".join(str(transform.shape) for transform in transforms[:4])
            raise InputError(f"transforms have the shapes {shapes}, expected equal ones")
        return cls.adopt(np.stack([t.rotation for t in transforms]), np.stack([t.translation for t in transforms]))

    def log(self) -> Array:
        """Tangents, (..., 6) [m, rad], with rotation angle in [0, pi]."""
        w = rotation_log(self.rotation)
        _, b, c = exp_coefficients(np.linalg.norm(w, axis=-1))
        k = cross_matrix(w)
        left_jacobian = np.eye(3) + b[..., None, None] * k + c[..., None, None] * (k @ k)
        v = np.linalg.solve(left_jacobian, self.translation[..., None])[..., 0]
        return np.concatenate([v, w], axis=-1)

    def inverse(self) -> SE3:
        """Return `b_from_a` of an `a_from_b`."""
        rt = self.rotation.mT
        return SE3.adopt(rt.copy(), -_rotate(rt, self.translation))

    def adjoint(self) -> Array:
        """Adjoint matrices, (..., 6, 6): `T @ exp(xi) == exp(T.adjoint() @ xi) @ T`."""
        out = np.zeros((*self.shape, 6, 6))
        self.put_adjoint(out, 1.0)
        return out

    def put_adjoint(self, zeros: Array, sign: float) -> None:
        """Write the adjoint, times 1 or -1, into a view (..., 6, 6) of zeros: twice as fast as a copy."""
        rotation = self.rotation if sign > 0 else -self.rotation
        zeros[..., :3, :3] = zeros[..., 3:, 3:] = rotation
        t = self.translation[..., None]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            np.subtract(t[..., j, :] * rotation[..., k, :], t[..., k, :] * rotation[..., j, :], out=zeros[..., i, 3:])

    @overload
    def __matmul__(self, other: SE3) -> SE3: ...
    @overload
    def __matmul__(self, other: Array | Sequence[float] | Sequence[Sequence[float]]) -> Array: ...
    def __matmul__(self, other: Any) -> SE3 | Array:
        if isinstance(other, SE3):
            try:
                return SE3.adopt(_product(self.rotation, other.rotation), self._move(other.translation))
            except ValueError:
                raise InputError(f"batches of {self.shape} and {other.shape} transforms do not match") from None
        if not isinstance(other, np.ndarray | Sequence):
            return NotImplemented
        points = np.asarray(other) if isinstance(other, np.ndarray) else read_only(other, name="points")
        try:
            return self._move(points)
        except (TypeError, ValueError):
            expected = f"expected (..., 3) for transforms of shape {self.shape}"
            raise InputError(f"points have shape {points.shape}, {expected}") from None

    def _move(self, points: Array) -> Array:
        moved = _rotate(self.rotation, points)
        moved += self.translation
        return moved

    def __getitem__(self, index: Any) -> SE3:
        if self.translation.ndim == 1 and index is not None:
            raise TypeError("a single transform has no entries")
        return SE3.adopt(self.rotation[index], self.translation[index])

    def __iter__(self) -> Iterator[SE3]:
        return (self[i] for i in range(len(self)))

    def __len__(self) -> int:
        if self.translation.ndim == 1:
            raise TypeError("a single transform has no length")
        return len(self.translation)

    def __bool__(self) -> bool:
        return self.translation.ndim == 1 or len(self) > 0

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch; () for a single transform."""
        return self.translation.shape[:-1]

    def add_axis(self) -> SE3:
        """Add a last batch axis of length 1 for broadcasting, (..., 1)."""
        return SE3.adopt(self.rotation[..., None, :, :], self.translation[..., None, :])

    def repeat(self, count: int) -> SE3:
        """Repeat a single transform, (count,)."""
        rotation = np.broadcast_to(self.rotation, (count, 3, 3))
        return SE3.adopt(rotation, np.broadcast_to(self.translation, (count, 3)))

    def __repr__(self) -> str:
        """Summary in one line: translation [m] and rotation vector [rad], or the shape of a batch."""
        if self.shape:
            return f"SE3({' x '.join(map(str, self.shape))} transforms)"
        t, w = (", ".join(f"{value:.5g}" for value in values) for values in (self.translation, self.rotvec))
        return f"SE3(t = [{t}] m, rotvec = [{w}] rad)"

    @property
    def matrix(self) -> Array:
        """Homogeneous matrices, (..., 4, 4)."""
        out = np.zeros((*self.translation.shape[:-1], 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = self.rotation, self.translation, 1.0
        return out

    @property
    def quaternion(self) -> Array:
        """Unit quaternions (x, y, z, w) with w >= 0, (..., 4)."""
        return quaternion_from_rotation(self.rotation)

    @property
    def rotvec(self) -> Array:
        """Rotation vectors, (..., 3) [rad]."""
        return rotation_log(self.rotation)

    @property
    def rpy(self) -> Array:
        """Angles about the fixed axes x, y, z, (..., 3) [rad]; see `rpy_of_rotation`."""
        return rpy_of_rotation(self.rotation)
