"""Figures with their words."""

from __future__ import annotations

import re

import pytest

from basecal.reporting.figures.figure import BAR, HEIGHT, bar


@pytest.mark.parametrize(("share", "height"), [(0.5, 0.5 * HEIGHT), (3.0, HEIGHT), (0.0, 0.5)])
def test_a_bar_ends_with_the_figure(share: float, height: float) -> None:
    """It stands on the ground, and one of nothing is still to be seen."""
    drawn = bar(20.0, BAR, share, "x")
    found = re.search(r'y="([\d.]+)" height="([\d.]+)"', drawn)
    assert found is not None
    assert float(found[2]) == height
    assert float(found[1]) + float(found[2]) == HEIGHT


def test_a_bar_of_a_sample_can_be_chosen() -> None:
    """All of its column can be hit; its label cannot be markup."""
    drawn = bar(0.0, BAR, 0.5, "a < b", 7, "view stranger")
    assert 'data-sample="7"' in drawn
    assert 'class="view stranger"' in drawn
    assert f'class="hit" x="0.00" y="0" width="{BAR:.2f}" height="{HEIGHT:g}"' in drawn
    assert "a &lt; b" in drawn
    assert "data-sample" not in bar(0.0, BAR, 0.5, "x")
