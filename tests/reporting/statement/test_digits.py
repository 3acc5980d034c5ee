"""Digits by sigma."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.reporting.statement.digits import shown_decimals, two_digits


@pytest.mark.parametrize(("sigma", "decimals"), [(0.0, 4), (0.02, 3), (0.95, 2), (1.0, 1), (37.0, 0), (1e-9, 6)])
def test_the_smallest_sigma_shows_two_digits(sigma: float, decimals: int) -> None:
    """Whatever larger ones stand beside it; six decimals at most, four of what is exact."""
    assert shown_decimals(np.array([sigma, 100 * sigma, 0.0])) == decimals


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0, "0"), (3.41, "3.4"), (0.0987, "0.099"), (-0.5, "-0.50"), (123.4, "123"), (np.inf, "inf")]
)
def test_two_digits(value: float, shown: str) -> None:
    """Without an exponent; the whole part is never cut."""
    assert two_digits(value) == shown
