"""Digits of sigmas and errors in text."""

from __future__ import annotations

import math

import pytest

from basecal.fields.digits import two_digits


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (3.41, "3.4"),
        (0.0987, "0.099"),
        (0.0996, "0.10"),
        (9.96, "10"),
        (-0.5, "-0.50"),
        (123.4, "123"),
        (1480.0, "1480"),
        (-1e-9, "0"),
        (math.inf, "inf"),
    ],
)
def test_two_digits(value: float, shown: str) -> None:
    """Without an exponent; the whole part is never cut, and rounding adds no digit."""
    assert two_digits(value) == shown
