"""Pose conventions of controllers: order, units and rotation form of the numbers, for reading and writing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.euler import rpy_of_rotation, zyz_of_rotation
from basecal.geometry.rotation import quaternion_from_rotation, rotation_exp, rotation_log

MILLIMETRE = 1e-3
METRE = 1.0
DEGREE = math.radians(1)
RADIAN = 1.0


@dataclass(frozen=True)
class RotationForm:
    """Representation of a rotation by k numbers.

    Attributes:
        read: Function from numbers (..., k) to rotation matrices (..., 3, 3); angles in radians.
        to_numbers: Inverse function, from rotation matrices to numbers.
        words: Description of the numbers.
    """

    read: Callable[[Array], Array]
    to_numbers: Callable[[Array], Array]
    words: str


@dataclass(frozen=True)
class Convention:
    """A controller's notation of a pose `a_from_b`: the position of b's origin in a, and the rotation of its axes.

    Attributes:
        names: Names of the numbers: three lengths, then those of the rotation.
        length: Unit of length [m].
        angle: Unit of angle [rad]; 1 if there are no angles.
        form: Representation of the rotation.
    """

    names: tuple[str, ...]
    length: float
    angle: float
    form: RotationForm

    @property
    def has_angles(self) -> bool:
        """Whether the rotation is given by angles."""
        return "quaternion" not in self.form.words

    def read(self, numbers: Array) -> SE3:
        """Convert numbers, (..., 6 or 7), to poses, (...)."""
        return SE3(self.form.read(numbers[..., 3:] * self.angle), numbers[..., :3] * self.length)

    def to_numbers(self, pose: SE3) -> Array:
        """Convert poses, (...), to numbers, (..., 6 or 7)."""
        rotation = self.form.to_numbers(pose.rotation) / self.angle
        return np.concatenate([pose.translation / self.length, rotation], -1)


@dataclass(frozen=True)
class MatrixConvention:
    """A controller's notation of a pose by the 16 numbers of a homogeneous matrix; see `Convention`.

    Attributes:
        names: Names of the numbers.
        length: Unit of length [m].
        is_by_columns: Whether the matrix is written column by column; if False, row by row.
        angle: Always 1: the notation has no angles.
    """

    names: tuple[str, ...]
    length: float
    is_by_columns: bool
    angle: float = RADIAN
    has_angles: ClassVar[bool] = False

    def read(self, numbers: Array) -> SE3:
        """Convert numbers, (..., 16), to poses, (...).

        Raises:
            InputError: if the numbers are not a rigid transform.
        """
        matrix = numbers.reshape(*numbers.shape[:-1], 4, 4)
        if _is_homogeneous(matrix) and self.is_by_columns and not _is_homogeneous(matrix.mT):
            raise InputError("the last row of the matrix is 0 0 0 1: it is written by rows, give --format matrix")
        if _is_homogeneous(matrix.mT) and not self.is_by_columns and not _is_homogeneous(matrix):
            raise InputError("the last column of the matrix is 0 0 0 1: it is transposed, give --format franka")
        pose = SE3.from_matrix(matrix.mT if self.is_by_columns else matrix)
        return SE3(pose.rotation, pose.translation * self.length)

    def to_numbers(self, pose: SE3) -> Array:
        """Convert poses, (...), to numbers, (..., 16)."""
        matrix = SE3(pose.rotation, pose.translation / self.length).matrix
        ordered = matrix.mT if self.is_by_columns else matrix
        return ordered.reshape(*ordered.shape[:-2], 16)


def _is_homogeneous(matrix: Array) -> bool:
    """Whether the last row of each matrix is 0 0 0 1."""
    return bool(np.allclose(matrix[..., 3, :], (0, 0, 0, 1)))


AnyConvention = Convention | MatrixConvention


def _rotation_from_rpy(angles: Array) -> Array:
    return SE3.from_rpy(angles, np.zeros_like(angles)).rotation


def _rotation_from_zyz(angles: Array) -> Array:
    first, second, third = (angles[..., i : i + 1] for i in range(3))
    z, y = np.eye(3)[2], np.eye(3)[1]
    return rotation_exp(first * z) @ rotation_exp(second * y) @ rotation_exp(third * z)


def _rotation_from_unit(q_xyzw: Array) -> Array:
    """Rotations (..., 3, 3) from rounded quaternions (..., 4).

    Raises:
        InputError: if a norm is not 1 within 1e-3.
    """
    return SE3.from_quaternion(q_xyzw, np.zeros((*q_xyzw.shape[:-1], 3))).rotation


ROTATION_VECTOR = RotationForm(rotation_exp, rotation_log, "rotation vector")
FIXED_XYZ = RotationForm(_rotation_from_rpy, rpy_of_rotation, "angles about fixed x, y, z")
"""About the fixed axes x, y, z: Rz(c) Ry(b) Rx(a)."""
MOVING_ZYX = RotationForm(
    lambda abc: _rotation_from_rpy(abc[..., ::-1]),
    lambda r: rpy_of_rotation(r)[..., ::-1],
    "angles about z, the new y, the new x",
)
"""About z, the new y, the new x: Rz(a) Ry(b) Rx(c); the angles of `FIXED_XYZ` in reverse order."""
MOVING_XYZ = RotationForm(
    lambda abc: _rotation_from_rpy(-abc).mT,
    lambda r: -rpy_of_rotation(r.mT),
    "angles about x, the new y, the new z",
)
"""About x, the new y, the new z: Rx(a) Ry(b) Rz(c)."""
MOVING_ZYZ = RotationForm(_rotation_from_zyz, zyz_of_rotation, "angles about z, the new y, the new z")
"""About z, the new y, the new z: Rz(a) Ry(b) Rz(c)."""
QUATERNION_WXYZ = RotationForm(
    lambda q: _rotation_from_unit(np.roll(q, -1, axis=-1)),
    lambda r: np.roll(quaternion_from_rotation(r), 1, axis=-1),
    "quaternion, scalar first",
)
QUATERNION_XYZW = RotationForm(_rotation_from_unit, quaternion_from_rotation, "quaternion, scalar last")
