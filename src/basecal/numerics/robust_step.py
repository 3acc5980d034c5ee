"""A step downhill of residuals of which large ones count less."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from basecal.geometry import Array

STEP = 1e-6
"""Of a difference that gives a slope; below it a step is none."""

NORMAL_MAD = 1.4826
"""Sigma of a normal distribution over its median absolute deviation, its upper quartile."""

_DAMPING = 1e-9  # of the diagonal


def robust_step(
    residuals: Callable[[Array], Array], width: int, tail: float, prior: Array | None = None, pull: Array | None = None
) -> Array:
    """The Gauss-Newton step with Cauchy weights, (width,).

    Args:
        residuals: (n, k) after a step.
        width: Numbers of a step.
        tail: Length of a row from which on it counts less.
        prior: (width, width) information beside the residuals.
        pull: (width,) gradient of that.
    """
    now = residuals(np.zeros(width))
    slope = np.stack([(residuals(STEP * axis) - now) / STEP for axis in np.eye(width)], -1)
    scale = 1 / np.sqrt(1 + np.sum(now**2, 1, keepdims=True) / tail**2)
    rows, right = (scale[..., None] * slope).reshape(-1, width), (scale * now).ravel()
    information, gradient = rows.T @ rows, rows.T @ right
    if prior is not None and pull is not None:
        information, gradient = information + prior, gradient + pull
    return np.asarray(-np.linalg.solve(information + _DAMPING * np.diag(np.diag(information) + 1e-12), gradient))
