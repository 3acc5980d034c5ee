"""Second-order curvature of residuals: the part of the cost's curvature that J'J omits, estimated from steps.

For large residuals of a nonlinear model, Gauss-Newton steps are too long or too short by a constant factor. The change
of the gradient over a step determines this factor. A symmetric rank-one update of the Hessian corrects it in the
direction of the step.
Source: Dennis, Gay, Welsch 1981, "An adaptive nonlinear least-squares algorithm" (NL2SOL); the update is SR1.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array, BoolArray

_LEAST_SHARE = 0.01  # relative to the curvature along a step: smaller corrections have no effect on convergence
# Least cosine of the missing change of the gradient and the step, scaled by the diagonal: below it, the update divides
# by nearly zero. Source: Nocedal & Wright 2006, (6.26).
_LEAST_COSINE = 0.01
# Least diagonal with negative curvature, relative to that of J'J: with less, steps would leave the explored region.
_LEAST_DIAGONAL_SHARE = 0.1


def with_secant(residual_curvature: Array, hessian: Array, change: Array, step: Array, is_near: BoolArray) -> Array:
    """Update the second-order curvature of residuals after a step, (b, p, p); zero if the step is not near an optimum.

    Args:
        residual_curvature: Previous curvature, (b, p, p).
        hessian: J'J after the step, (b, p, p).
        change: Change of the gradient over the step, (b, p).
        step: The step, (b, p).
        is_near: (b,) whether the step was accepted and is near enough to an optimum.
    """
    updated = np.where(is_near[:, None, None], residual_curvature, 0.0)
    if not is_near.any():
        return updated
    with np.errstate(all="ignore"):
        by_hessian = (hessian @ step[..., None])[..., 0]
        missing = change - by_hessian - (updated @ step[..., None])[..., 0]
        along, curvature = np.einsum("bi,bi->b", missing, step), np.einsum("bi,bi->b", by_hessian, step)
        diagonal = np.maximum(np.diagonal(hessian, axis1=1, axis2=2), np.finfo(np.float64).tiny)
        is_used = is_near & np.isfinite(along) & (np.abs(along) > _LEAST_SHARE * curvature) & (curvature > 0)
        lengths = np.sqrt((missing**2 / diagonal).sum(axis=1) * (step**2 * diagonal).sum(axis=1))
        is_used &= np.abs(along) >= _LEAST_COSINE * lengths
    rows = np.flatnonzero(is_used)
    corrections = missing[rows]
    updated[rows] += corrections[:, :, None] * corrections[:, None, :] / along[rows, None, None]
    return updated


def usable_curvature(residual_curvature: Array, hessian: Array) -> Array:
    """Second-order curvature if the Hessian's diagonal stays sufficiently positive with it, else zero, (b, p, p)."""
    diagonal, change = (np.diagonal(matrix, axis1=1, axis2=2) for matrix in (hessian, residual_curvature))
    is_usable = np.all(diagonal + change >= _LEAST_DIAGONAL_SHARE * diagonal, axis=1)
    return np.where(is_usable[:, None, None], residual_curvature, 0.0)
