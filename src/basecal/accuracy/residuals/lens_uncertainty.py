"""Uncertainty of an estimated lens over its image."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array, Camera
from basecal.numerics.spectral import pseudo_inverse


def lens_sigmas(camera: Camera, covariance: Array, pixels: Array) -> Array:
    """Sigma per axis of the projections of known rays, (n,) [px]; NaN at pixels without a ray.

    Rotations of the camera are removed, as mounts absorb them. The rotation is fitted over all pixels.

    Args:
        camera: The estimated lens.
        covariance: (p, p) covariance of the lens parameters.
        pixels: (n, 2) pixels of the rays [px].
    """
    rays, valid = camera.undistort(pixels)
    sigmas = np.full(len(pixels), np.nan)
    _, by_ray, by_lens = camera.project_with_derivatives(rays[valid], intrinsics=True)
    assert by_lens is not None
    turned = np.cross(np.eye(3), rays[valid][:, None])  # each row: change of the ray by a rotation
    by_rotation = np.einsum("nij,nkj->nik", by_ray, turned).reshape(-1, 3)
    by_lens = by_lens[..., : len(covariance)].reshape(-1, len(covariance))
    moved = by_lens - by_rotation @ (pseudo_inverse(by_rotation) @ by_lens)
    variances = np.einsum("np,pq,nq->n", moved, covariance, moved).reshape(-1, 2)
    sigmas[valid] = np.sqrt(variances.mean(-1))
    return sigmas
