"""Tests of sigmas and errors in text with two significant digits."""

from __future__ import annotations

import math

import pytest

from basecal.fields.digits import p_value_text, two_digits


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
    """Values print with two significant digits and no exponent.

    The whole part is never cut, and rounding adds no digit.
    """
    assert two_digits(value) == shown


@pytest.mark.parametrize(
    ("chance", "shown"),
    [(0.4, "p = 0.4"), (2.31e-9, "p = 2.3e-09"), (1e-299, "p = 1e-299"), (5e-324, "p < 1e-300"), (0.0, "p < 1e-300")],
)
def test_a_p_value_is_never_zero(chance: float, shown: str) -> None:
    """A probability that underflows is a bound."""
    assert p_value_text(chance) == shown
