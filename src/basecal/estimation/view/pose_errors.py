"""Error model of poses estimated from a flat target, as a function of distance, size and tilt.

The tilt of a target seen from the front follows from perspective alone, ten times less accurately than from an oblique
view. The covariance is the inverse information of the four corners of a square, seen by a pinhole camera. Only the size
of the square has to be known. Near the frontal view, the corners of a target with the opposite tilt have almost the
same pixels. Therefore poses are compared by their projected corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.view.measurement import take_batch_rows
from basecal.geometry import SE3, Array, Rows
from basecal.geometry.rotation import cross_matrix

_CORNERS = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
_BLOCK_FREEDOMS = 3  # degrees of freedom of a translation, and of a rotation
_LEAST_DEPTH_SHARE = 0.1  # least depth, relative to half a side: depths of trial poses are clipped to it; assumed


@dataclass(frozen=True, eq=False)
class CornerErrors:
    """Differences of poses, measured by the projected corners of a square; equal to tangents to first order.

    Attributes:
        half_size_m: Half the side of the square [m].
        whitening: (n, 6, 8) matrices from corners [focal lengths] to differences [m, rad], which are independent and of
            equal variance over views.
    """

    half_size_m: float
    whitening: Array

    @classmethod
    def from_poses(cls, camera_from_target: SE3, half_size_m: float) -> CornerErrors:
        """Make the error model at poses, (n,)."""
        jacobian = _corner_jacobian(camera_from_target, half_size_m)
        covariance = corner_covariances(camera_from_target, half_size_m)
        return cls(half_size_m, whitening_matrix(covariance) @ covariance @ jacobian.mT)

    def differences(self, measured_camera_from_target: SE3, camera_from_target: SE3) -> Array:
        """Whitened differences of poses, (..., n), from measured poses, (..., n, 6) [m, rad]."""
        poses = camera_from_target, measured_camera_from_target
        corners, measured_corners = (_project_corners(each, self.half_size_m) for each in poses)
        return np.asarray((self.whitening @ (corners - measured_corners)[..., None])[..., 0])

    def jacobian(self, camera_from_target: SE3) -> Array:
        """Derivative of the differences with respect to right tangents of poses, (..., n, 6, 6)."""
        return np.asarray(self.whitening @ _corner_jacobian(camera_from_target, self.half_size_m))

    def take_batch(self, rows: Rows) -> CornerErrors:
        """Select entries of a batch; whitening without a batch axis is shared."""
        return CornerErrors(self.half_size_m, take_batch_rows(self.whitening, rows, 3))


def corner_covariances(camera_from_target: SE3, half_size_m: float) -> Array:
    """Pose covariances (n, 6, 6) [m, rad], in the target's axes, for a pixel sigma of one focal length.

    Args:
        camera_from_target: (n,) poses of a target whose plane is z = 0.
        half_size_m: Half the side of a square in this plane [m].
    """
    jacobian = _corner_jacobian(camera_from_target, half_size_m)
    return np.asarray(np.linalg.inv(jacobian.mT @ jacobian), dtype=np.float64)


def _corners_in_camera(camera_from_target: SE3, half_size_m: float) -> tuple[Array, Array, Array]:
    points = camera_from_target.add_axis() @ (half_size_m * _CORNERS)
    x, y, z = np.moveaxis(points, -1, 0)
    return x, y, np.maximum(z, _LEAST_DEPTH_SHARE * half_size_m)


def _project_corners(camera_from_target: SE3, half_size_m: float) -> Array:
    """Pinhole projection of the corners of a square, (..., 8) [focal lengths]."""
    x, y, z = _corners_in_camera(camera_from_target, half_size_m)
    image = np.stack([x / z, y / z], -1)
    return image.reshape(*image.shape[:-2], -1)


def _corner_jacobian(camera_from_target: SE3, half_size_m: float) -> Array:
    """Derivative of the projected corners with respect to a right tangent of the pose, (..., 8, 6)."""
    by_tangent = np.concatenate([np.broadcast_to(np.eye(3), (4, 3, 3)), -cross_matrix(half_size_m * _CORNERS)], axis=-1)
    x, y, z = _corners_in_camera(camera_from_target, half_size_m)
    one, zero = np.ones_like(z), np.zeros_like(z)
    by_point = np.stack([np.stack([one, zero, -x / z], -1), np.stack([zero, one, -y / z], -1)], -2) / z[..., None, None]
    jacobian = by_point @ camera_from_target.rotation[..., None, :, :] @ by_tangent
    return np.asarray(jacobian.reshape(*jacobian.shape[:-3], -1, 6))


def whitening_matrix(covariance: Array) -> Array:
    """Block-triangular matrices (n, 6, 6) that whiten errors (n, 6) [m, rad] up to a common scale.

    The mean logarithm of the variances over all views is unchanged. Conditional translations, given the rotation, and
    rotations therefore keep their units and their typical size.
    """
    translation_block, rotation_block = covariance[:, :3, :3], covariance[:, 3:, 3:]
    lever = covariance[:, :3, 3:] @ np.linalg.inv(rotation_block)
    matrix = np.zeros_like(covariance)
    matrix[:, :3, :3] = _unit_root(translation_block - lever @ covariance[:, 3:, :3])
    matrix[:, 3:, 3:] = _unit_root(rotation_block)
    matrix[:, :3, 3:] = -matrix[:, :3, :3] @ lever
    return matrix


def _unit_root(covariance: Array) -> Array:
    """Inverse square roots (n, 3, 3) of covariances, scaled to a geometric mean determinant of 1."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    log_scale = np.linalg.slogdet(root)[1].mean() / _BLOCK_FREEDOMS
    return np.asarray(root / np.exp(log_scale))
