"""How uncertain an estimated lens is over its image."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array, Camera
from basecal.numerics.spectral import pseudo_inverse


def lens_sigmas(camera: Camera, covariance: Array, pixels: Array) -> Array:
    """Sigma per axis of where the lens images known rays, (n,) [px]; NaN where no ray leads to.

    Rotations of the camera are left out: mounts absorb them. The rotation is fitted over all pixels.

    Args:
        camera: The lens as estimated.
        covariance: Of its parameters, (p, p).
        pixels: (n, 2) [px].
    """
    rays, valid = camera.undistort(pixels)
    sigmas = np.full(len(pixels), np.nan)
    _, by_ray, by_lens = camera.project_with_derivatives(rays[valid], intrinsics=True)
    assert by_lens is not None
    turned = np.cross(np.eye(3), rays[valid][:, None])  # each row: the ray moved by a rotation about an axis
    by_rotation = np.einsum("nij,nkj->nik", by_ray, turned).reshape(-1, 3)
    by_lens = by_lens[..., : len(covariance)].reshape(-1, len(covariance))
    moved = by_lens - by_rotation @ (pseudo_inverse(by_rotation) @ by_lens)
    variances = np.einsum("np,pq,nq->n", moved, covariance, moved).reshape(-1, 2)
    sigmas[valid] = np.sqrt(variances.mean(-1))
    return sigmas
