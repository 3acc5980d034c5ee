"""Second-order curvature of residuals: the part of the cost's curvature that J'J omits, estimated from steps.

Where residuals are large and the model is curved, steps of Gauss-Newton overshoot or fall short by the same share
each time. The change of the gradient over a step gives this share; a symmetric matrix of rank one then fixes that
direction.
Source: Dennis, Gay, Welsch 1981, "An adaptive nonlinear least-squares algorithm" (NL2SOL); the update is SR1.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array, BoolArray

_LEAST_SHARE = 0.01  # of the curvature along a step: less slows no descent
# Of the scaled diagonal, by which an update may change it: residuals that bend more are no optimum's, and next to
# nothing along a step would be divided by.
_LARGEST_CHANGE = 1.0
_LEAST_DIAGONAL_SHARE = (
    0.1  # of the diagonal, where residuals bend away from it: with less a step is beyond all that was seen
)


def with_secant(bend: Array, hessian: Array, change: Array, step: Array, is_near: BoolArray) -> Array:
    """The bend of residuals after a step, none if it was not near an optimum, (b, p, p).

    Args:
        bend: As known before, (b, p, p).
        hessian: J'J after the step, (b, p, p).
        change: Of the gradient over the step, (b, p).
        step: (b, p).
        is_near: (b,) whether the step was taken and near enough to an optimum to be used.
    """
    kept = np.where(is_near[:, None, None], bend, 0.0)
    if not is_near.any():
        return kept
    with np.errstate(all="ignore"):
        by_hessian = (hessian @ step[..., None])[..., 0]
        missed = change - by_hessian - (kept @ step[..., None])[..., 0]
        along, curvature = np.einsum("bi,bi->b", missed, step), np.einsum("bi,bi->b", by_hessian, step)
        diagonal = np.maximum(np.diagonal(hessian, axis1=1, axis2=2), np.finfo(np.float64).tiny)
        tells = is_near & np.isfinite(along) & (np.abs(along) > _LEAST_SHARE * curvature) & (curvature > 0)
        tells &= (missed**2 / diagonal).sum(axis=1) <= _LARGEST_CHANGE * np.abs(along)
    rows = np.flatnonzero(tells)
    told = missed[rows]
    kept[rows] += told[:, :, None] * told[:, None, :] / along[rows, None, None]
    return kept


def usable_curvature(bend: Array, hessian: Array) -> Array:
    """The bend of residuals where it leaves enough of the hessian's diagonal, none elsewhere, (b, p, p)."""
    diagonal, change = (np.diagonal(of, axis1=1, axis2=2) for of in (hessian, bend))
    leaves = np.all(diagonal + change >= _LEAST_DIAGONAL_SHARE * diagonal, axis=1)
    return np.where(leaves[:, None, None], bend, 0.0)
