"""Digits of sigmas and errors in text."""

from __future__ import annotations

import math

_SIGNIFICANT = 2  # digits of a sigma: the second is uncertain itself
_MOST_DECIMALS = 6


def two_digits(value: float) -> str:
    """A sigma or an error with two significant digits and no exponent."""
    text = f"{value:.{two_digit_decimals(abs(value))}f}"
    return "0" if float(text) == 0 else text


def p_value_text(chance: float, digits: int = 2) -> str:
    """A p-value, such as `p = 2.3e-09`; one too small for a number is `p < 1e-300`."""
    return f"p = {chance:.{digits}g}" if chance > 1e-300 else "p < 1e-300"


def two_digit_decimals(size: float, limit: int = _MOST_DECIMALS) -> int:
    """Number of decimals with which a positive number has two significant digits; at most `limit`."""
    if size == 0 or not math.isfinite(size):
        return 0
    exponent = int(f"{size:.{_SIGNIFICANT - 1}e}".partition("e")[2])  # after rounding: 0.0996 is 0.10
    return min(max(_SIGNIFICANT - 1 - exponent, 0), limit)
