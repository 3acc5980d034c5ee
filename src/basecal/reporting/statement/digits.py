"""Numbers with the digits that their sigma justifies: two of the sigma, the same on every surface."""

from __future__ import annotations

import math

from basecal.geometry import Array

_SIGNIFICANT = 2  # digits of a sigma: the second is uncertain itself
_EXACT_DECIMALS, _MOST_DECIMALS = 4, 6  # of mm and deg: where nothing is uncertain, and at most


def shown_decimals(sigmas: Array) -> int:
    """Decimals with which the smallest of these sigmas shows two digits; those of an exact value if all are zero."""
    uncertain = sigmas[sigmas > 0]
    return _EXACT_DECIMALS if len(uncertain) == 0 else _decimals(float(uncertain.min()))


def two_digits(value: float) -> str:
    """A sigma or an error with two significant digits and no exponent."""
    return "0" if value == 0 else f"{value:.{_decimals(abs(value))}f}"


def _decimals(size: float) -> int:
    if not math.isfinite(size):
        return 0
    return min(max(_SIGNIFICANT - 1 - math.floor(math.log10(size)), 0), _MOST_DECIMALS)
