"""Tests of the scales, ticks and rules of charts."""

from __future__ import annotations

import numpy as np
import pytest
from tests.drawings import ends, labels

from basecal.reporting.charts import fitted_scale, horizontal_rules, value_text


def test_scale_is_logarithmic_for_wide_ranges():
    """A scale without a stated type is logarithmic if the values span a wide range.

    Its ends lie beyond the values, and its ticks are round values.
    """
    assert fitted_scale([1.0, 100.0], 0.0, 10.0).logarithmic
    near = fitted_scale([1.0, 2.0], 0.0, 10.0)
    assert not near.logarithmic
    assert 0 < near.position(1.0) < near.position(2.0) < 10
    assert near.ticks() == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    assert fitted_scale([1.0, 2.0], 0.0, 10.0, logarithmic=True).logarithmic


@pytest.mark.parametrize(("values", "ticks"), [
    ([1.0, 4.0], [1, 2, 3, 4]), ([1.0, 3.0], [1, 1.5, 2, 2.5, 3]), ([-20.0, 20.0], [-20, -10, 0, 10, 20]),
    ([1.0, 1.3], [1, 1.1, 1.2, 1.3]),
])  # fmt: skip
def test_linear_axis_has_at_least_four_ticks(values, ticks):
    """The ticks of a linear axis have the roundest step that gives at least four of them."""
    assert fitted_scale(values, 0.0, 10.0, logarithmic=False).ticks() == pytest.approx(ticks)


def test_scale_has_margins_of_six_percent():
    """The ends of the drawing lie 6 % beyond the outermost values, or their logarithms on a logarithmic scale."""
    scale = fitted_scale([1.0, 3.0], 100.0, 212.0, logarithmic=False)
    assert [scale.position(value) for value in (1.0, 2.0, 3.0)] == pytest.approx([106, 156, 206])
    log = fitted_scale([1.0, 100.0], 100.0, 212.0)
    assert [log.position(value) for value in (1.0, 10.0, 100.0)] == pytest.approx([106, 156, 206])
    downwards = fitted_scale([1.0, 3.0], 212.0, 100.0, logarithmic=False)
    assert downwards.position(1.0) == pytest.approx(206)


@pytest.mark.parametrize(("values", "wide"), [([1.0, 8.0], False), ([1.0, 8.1], True), ([0.0, 9.0], False)])
def test_range_above_factor_eight_is_wide(values, wide):
    """A scale of positive numbers is logarithmic if the largest is more than eight times the smallest."""
    assert fitted_scale(values, 0.0, 1.0).logarithmic == wide


@pytest.mark.parametrize(("value", "low", "high"), [(4.0, 2.0, 6.0), (-4.0, -6.0, -2.0), (0.0, -1.0, 1.0)])
def test_scale_of_single_value_has_margins(value, low, high):
    """A scale of a single value extends by half of its magnitude on both sides, or by one if the value is zero."""
    scale = fitted_scale([value], 0.0, 1.0)
    assert (scale.low, scale.high) == (low, high)


@pytest.mark.parametrize(
    ("values", "ticks"),
    [
        ([1.0, 50.0], [1, 2, 5, 10, 20, 50]),
        ([1.0, 500.0], [1, 10, 100]),
        ([0.001, 10.0], [0.001, 0.01, 0.1, 1, 10]),
        ([0.3, 30.0], [0.5, 1, 2, 5, 10, 20]),
    ],
)
def test_logarithmic_ticks_are_round(values, ticks):
    """Logarithmic ticks are 1, 2 and 5 of each decade; ranges of three decades and more have only powers of ten."""
    assert fitted_scale(values, 0.0, 1.0, logarithmic=True).ticks() == pytest.approx(ticks)


def test_horizontal_rules_are_labelled_on_the_left():
    """Each tick has a horizontal rule across the chart, with its number to the left of it."""
    scale = fitted_scale([1.0, 4.0], 200.0, 0.0, logarithmic=False)
    svg = "<svg>" + "".join(horizontal_rules(scale, 60.0, 300.0)) + "</svg>"
    rules, numbers = ends(svg, "rule"), labels(svg)
    assert [box.text for box in numbers] == ["1", "2", "3", "4"]
    for rule, box, value in zip(rules, numbers, (1.0, 2.0, 3.0, 4.0), strict=True):
        np.testing.assert_allclose(rule, [[60, scale.position(value)], [300, scale.position(value)]], atol=0.06)
        assert 50 < box.right < 60
        assert box.top < rule[0, 1] < box.bottom


def test_axis_values_have_no_trailing_zeros():
    """Values on axes are written without trailing zeros."""
    assert [value_text(value) for value in (5.0, 0.25, 7, "a", True)] == ["5", "0.25", "7", "a", "True"]
