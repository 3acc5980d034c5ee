"""How errors of a pose that was found from a flat target's points go with its distance, size and tilt.

A target seen from the front holds its tilt by perspective alone, a tenth as well as one seen aslant. The covariance is
the inverse of the information of four corners of a square, seen by a pinhole: their size is what has to be known.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array
from basecal.geometry.rotation import cross_matrix

_CORNERS = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
_BLOCK_FREEDOMS = 3  # of a translation, and of a rotation


def corner_covariances(camera_from_target: SE3, half_size_m: float) -> Array:
    """Covariances (n, 6, 6) [m, rad], in the target's axes, by pixels of a sigma of one focal length.

    Args:
        camera_from_target: (n,) poses of a target whose plane is z = 0.
        half_size_m: Half of the side of a square in it.
    """
    points_in_target = half_size_m * _CORNERS
    moved = np.concatenate([np.broadcast_to(np.eye(3), (4, 3, 3)), -cross_matrix(points_in_target)], axis=-1)
    points_in_camera = camera_from_target.spread() @ points_in_target
    x, y, z = np.moveaxis(points_in_camera, -1, 0)
    one, zero = np.ones_like(z), np.zeros_like(z)
    seen = np.stack([np.stack([one, zero, -x / z], -1), np.stack([zero, one, -y / z], -1)], -2) / z[..., None, None]
    jacobian = seen @ camera_from_target.rotation[..., None, :, :] @ moved
    rows = jacobian.reshape(len(jacobian), -1, 6)
    inverse: Array = np.linalg.inv(rows.mT @ rows)
    return inverse


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
