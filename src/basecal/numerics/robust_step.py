"""Gauss-Newton steps with a robust loss."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from basecal.geometry import Array

STEP = 1e-6
"""Step of finite differences; a smaller Gauss-Newton step counts as convergence."""

NORMAL_MAD = 1.4826
"""Sigma of a normal distribution divided by its median absolute deviation."""

_DAMPING = 1e-9  # relative to the diagonal


def robust_step(
    residuals: Callable[[Array], Array], width: int, tail: float, prior: Array | None = None, pull: Array | None = None
) -> Array:
    """Gauss-Newton step with Cauchy weights and a numerical Jacobian, (width,).

    Args:
        residuals: Function of a step that returns residuals, (n, k).
        width: Number of unknowns.
        tail: Scale of the Cauchy loss, for the norm of a row of residuals.
        prior: (width, width) prior information, or None.
        pull: (width,) gradient of the prior, or None.
    """
    now = residuals(np.zeros(width))
    slope = np.stack([(residuals(STEP * axis) - now) / STEP for axis in np.eye(width)], -1)
    scale = 1 / np.sqrt(1 + np.sum(now**2, 1, keepdims=True) / tail**2)
    rows, right = (scale[..., None] * slope).reshape(-1, width), (scale * now).ravel()
    information, gradient = rows.T @ rows, rows.T @ right
    if prior is not None and pull is not None:
        information, gradient = information + prior, gradient + pull
    return np.asarray(-np.linalg.solve(information + _DAMPING * np.diag(np.diag(information) + 1e-12), gradient))
