"""Errors of a pose that was found from a flat target's points, as they go with its distance, size and tilt.

A target seen from the front holds its tilt by perspective alone, a tenth as well as one seen aslant. The covariance is
the inverse of the information of four corners of a square, seen by a pinhole. Only the size of the square has to be
known. Seen nearly from the front a target tilted the other way has its corners at almost the same places, so poses are
compared by these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.view.measurement import take_batch_rows
from basecal.geometry import SE3, Array, Rows
from basecal.geometry.rotation import cross_matrix

_CORNERS = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
_BLOCK_FREEDOMS = 3  # of a translation, and of a rotation
_NEAREST = 0.1  # of half a side: a trial pose that is nearer, or behind the camera, counts as so near; assumed


@dataclass(frozen=True, eq=False)
class CornerErrors:
    """Differences of poses by where they put the corners of a square; to first order those of their tangents.

    Attributes:
        half_size_m: Half of the side of the square.
        whitening: (n, 6, 8) from corners in focal lengths to differences [m, rad], independent and equal over views.
    """

    half_size_m: float
    whitening: Array

    @classmethod
    def from_poses(cls, camera_from_target: SE3, half_size_m: float) -> CornerErrors:
        """Errors of the covariances that they have at poses, (n,)."""
        jacobian = _corner_jacobian(camera_from_target, half_size_m)
        covariance = corner_covariances(camera_from_target, half_size_m)
        return cls(half_size_m, whitening_matrix(covariance) @ covariance @ jacobian.mT)

    def differences(self, measured_camera_from_target: SE3, camera_from_target: SE3) -> Array:
        """Differences of poses, (..., n), from measured ones, (..., n, 6)."""
        poses = camera_from_target, measured_camera_from_target
        corners, measured_corners = (_corners(each, self.half_size_m) for each in poses)
        return np.asarray((self.whitening @ (corners - measured_corners)[..., None])[..., 0])

    def jacobian(self, camera_from_target: SE3) -> Array:
        """Derivative of the differences to right tangents of poses, (..., n, 6, 6)."""
        return np.asarray(self.whitening @ _corner_jacobian(camera_from_target, self.half_size_m))

    def take_batch(self, rows: Rows) -> CornerErrors:
        """The rows of a batch; what all rows share stays."""
        return CornerErrors(self.half_size_m, take_batch_rows(self.whitening, rows, 3))


def corner_covariances(camera_from_target: SE3, half_size_m: float) -> Array:
    """Covariances (n, 6, 6) [m, rad], in the target's axes, by pixels of a sigma of one focal length.

    Args:
        camera_from_target: (n,) poses of a target whose plane is z = 0.
        half_size_m: Half of the side of a square in it.
    """
    jacobian = _corner_jacobian(camera_from_target, half_size_m)
    return np.asarray(np.linalg.inv(jacobian.mT @ jacobian), dtype=np.float64)


def _points_in_camera(camera_from_target: SE3, half_size_m: float) -> tuple[Array, Array, Array]:
    points = camera_from_target.spread() @ (half_size_m * _CORNERS)
    x, y, z = np.moveaxis(points, -1, 0)
    return x, y, np.maximum(z, _NEAREST * half_size_m)


def _corners(camera_from_target: SE3, half_size_m: float) -> Array:
    """Where a pinhole sees the corners of a square, (..., 8), in focal lengths."""
    x, y, z = _points_in_camera(camera_from_target, half_size_m)
    seen = np.stack([x / z, y / z], -1)
    return seen.reshape(*seen.shape[:-2], -1)


def _corner_jacobian(camera_from_target: SE3, half_size_m: float) -> Array:
    """Derivative of the corners to a right tangent of the pose, (..., 8, 6)."""
    moved = np.concatenate([np.broadcast_to(np.eye(3), (4, 3, 3)), -cross_matrix(half_size_m * _CORNERS)], axis=-1)
    x, y, z = _points_in_camera(camera_from_target, half_size_m)
    one, zero = np.ones_like(z), np.zeros_like(z)
    seen = np.stack([np.stack([one, zero, -x / z], -1), np.stack([zero, one, -y / z], -1)], -2) / z[..., None, None]
    jacobian = seen @ camera_from_target.rotation[..., None, :, :] @ moved
    return np.asarray(jacobian.reshape(*jacobian.shape[:-3], -1, 6))


def whitening_matrix(covariance: Array) -> Array:
    """Lower blocks (n, 6, 6) that make errors (n, 6) [m, rad] of such covariances independent, of equal variance.

    Of all views the mean logarithm of a variance stays: translations given the rotation, and rotations, keep their
    units and their typical size.
    """
    of_t, of_r = covariance[:, :3, :3], covariance[:, 3:, 3:]
    lever = covariance[:, :3, 3:] @ np.linalg.inv(of_r)
    out = np.zeros_like(covariance)
    out[:, :3, :3] = _unit_root(of_t - lever @ covariance[:, 3:, :3])
    out[:, 3:, 3:] = _unit_root(of_r)
    out[:, :3, 3:] = -out[:, :3, :3] @ lever
    return out


def _unit_root(covariance: Array) -> Array:
    """Inverse roots (n, 3, 3) of covariances over their geometric mean."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    log = np.linalg.slogdet(root)[1].mean() / _BLOCK_FREEDOMS
    return np.asarray(root / np.exp(log))
