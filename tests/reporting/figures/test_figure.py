"""Figures with their words."""

from __future__ import annotations

import re

import pytest

from basecal.reporting.figures.figure import BAR, FAINTEST, HEIGHT, bar, tile


@pytest.mark.parametrize(("share", "height"), [(0.5, 0.5 * HEIGHT), (3.0, HEIGHT), (0.0, 0.5)])
def test_a_bar_ends_with_the_figure(share: float, height: float) -> None:
    """It stands on the ground, and one of nothing is still to be seen."""
    drawn = bar(20.0, BAR, share, "x", 7, "view")
    found = re.search(r'class="bar".* y="([\d.]+)" width="9.0" height="([\d.]+)"', drawn)
    assert found is not None
    assert float(found[2]) == height
    assert float(found[1]) + float(found[2]) == HEIGHT


def test_a_bar_of_a_sample_can_be_chosen() -> None:
    """All of its column can be hit; its label cannot be markup."""
    drawn = bar(0.0, BAR, 0.5, "a < b", 7, "view stranger")
    assert 'data-sample="7"' in drawn
    assert 'class="view stranger"' in drawn
    assert f'class="hit" x="0.0" y="0.0" width="{BAR:.1f}" height="{HEIGHT:.1f}"' in drawn
    assert "a &lt; b" in drawn


def test_a_tile_with_least_is_told_from_none() -> None:
    """From the faintest to full; a tile without words has no title."""
    shades = [float(re.findall(r'fill-opacity="([0-9.]+)"', tile((0, 0, 1, 1), share))[0]) for share in (0.0, 0.5, 1.0)]
    assert shades == [FAINTEST, (1 + FAINTEST) / 2, 1.0]
    assert "<title>a &lt; b</title>" in tile((0, 0, 1, 1), 0.5, "a < b")
    assert "<title>" not in tile((0, 0, 1, 1), 0.5)
