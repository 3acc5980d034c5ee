"""Check of analytic derivatives against differences."""

from collections.abc import Callable

import numpy as np

_WEIGHTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}


def check_derivative(
    function: Callable[[np.ndarray], np.ndarray], derivative: np.ndarray, step: float = 1e-2, tolerance: float = 1e-9
) -> None:
    """Check that `derivative`, (..., m, n), is that of `function`, (n,) to (..., m), at zero.

    The check takes central differences of sixth order. At the step 1e-2, truncation and rounding are both below 1e-11
    for functions of order 1. The tolerance is relative to the largest entry of the derivative.
    """
    numeric = np.empty_like(derivative)
    for column in range(derivative.shape[-1]):
        direction = np.eye(derivative.shape[-1])[column]
        numeric[..., column] = sum(
            weight * (function(k * step * direction) - function(-k * step * direction)) / step
            for k, weight in _WEIGHTS.items()
        )
    np.testing.assert_allclose(derivative, numeric, rtol=0, atol=tolerance * max(1.0, np.abs(derivative).max()))
