"""Marginalise errors that all points of a view share out of the normal equations of the view.

With a shared shift in the image, the covariance of a coordinate's residuals is diag(sigma^2) + tau^2 11'. Points of one
view are then not independent measurements of errors of the lens or of the exposure time. Source: Woodbury 1950;
docs/mathematics.md (2.8).
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array


def without_common_shift(
    view: tuple[Array, Array, Array], residual: Array, weight: Array, by_shift: Array, common_px: float
) -> tuple[Array, Array, Array]:
    """Cost, gradient and information of n views with a shared shift marginalised, an update of rank two.

    Args:
        view: Cost, gradient and information without a shared shift.
        residual: (..., n, 2, p) residuals in sigmas.
        weight: (..., n, p) 1 / sigma [1/px].
        by_shift: (..., n, 6 + k, 2) mixed second derivative with respect to the unknowns and the shift [1/px].
        common_px: Sigma of the shift, tau, per coordinate [px].
    """
    cost, gradient, information = view
    force = np.einsum("...ip,...p->...i", residual, weight)
    factor = 1 / (common_px**-2 + np.einsum("...p,...p->...", weight, weight))
    return (
        cost - factor * np.einsum("...i,...i->...", force, force),
        gradient - factor[..., None] * (by_shift @ force[..., None])[..., 0],
        information - factor[..., None, None] * by_shift @ by_shift.mT,
    )


def without_motion(cost: Array, gradient: Array, information: Array, motion: Array) -> tuple[Array, Array, Array]:
    """Cost, gradient and information of views with an error along a motion marginalised, an update of rank one.

    The error of each view is an independent standard normal. Source: docs/mathematics.md (12.6).

    Args:
        cost: (..., n) cost without the error.
        gradient: (..., n, 6 + k) gradient without the error.
        information: (..., n, 6 + k, 6 + k) information without the error.
        motion: (..., n, 6) right tangent of a unit error [m, rad].
    """
    information_along = (information[..., :6] @ motion[..., None])[..., 0]
    gradient_along = np.einsum("...i,...i->...", gradient[..., :6], motion)
    factor = 1 / (1 + np.einsum("...i,...i->...", information_along[..., :6], motion))
    return (
        cost - factor * gradient_along**2,
        gradient - (factor * gradient_along)[..., None] * information_along,
        information - factor[..., None, None] * information_along[..., :, None] * information_along[..., None, :],
    )
