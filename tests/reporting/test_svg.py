"""SVG by hand: numbers that are read, and round ones above what they must hold."""

from __future__ import annotations

import pytest

from basecal.reporting.svg import nice_ceiling, three_digits


@pytest.mark.parametrize(
    ("value", "shown"),
    [(6412.0, "6,410"), (6400.0, "6,400"), (12.345, "12.3"), (0.25, "0.25"), (1234567.0, "1,230,000")],
)
def test_numbers_are_read_without_exponents(value, shown):
    """Three digits, thousands set apart."""
    assert three_digits(value) == shown


@pytest.mark.parametrize(("value", "above"), [(0.3, 0.5), (1.0, 1.0), (2.1, 2.5), (70.0, 100.0), (0.0, 1.0)])
def test_round_numbers_are_not_below_a_value(value, above):
    """The next of 1, 2, 2.5 and 5 in its decade."""
    assert nice_ceiling(value) == pytest.approx(above)
