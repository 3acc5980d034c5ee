"""A number with its sigma, for people."""

from __future__ import annotations

import numpy as np


def rounded(value: float, sigma: float) -> str:
    """A value with its sigma to two digits."""
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma, 1e-9))), 0, 9))
    return f"{value:.{digits}f} +/- {sigma:.{digits}f}"
