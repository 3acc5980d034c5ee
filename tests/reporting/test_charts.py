"""Scales of charts."""

from __future__ import annotations

import pytest

from basecal.reporting.charts import fitted_scale


def test_a_scale_is_logarithmic_where_values_reach_far():
    """If it is not said; its ends are beyond the values, and round values lie in it."""
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
def test_an_axis_has_four_round_values_at_least(values, ticks):
    """Of the roundest step that gives as many."""
    assert fitted_scale(values, 0.0, 10.0, logarithmic=False).ticks() == pytest.approx(ticks)
