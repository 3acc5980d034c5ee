"""Curves with bands."""

from __future__ import annotations

import re

import pytest

from basecal.reporting.figures.curves import Band, Line, curves

NONE = Band(20, None, None, None)


def heights(svg: str) -> list[float]:
    return [float(y) for y in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)"', svg)]


def places(svg: str) -> list[float]:
    return [float(x) for x in re.findall(r'<circle cx="([\d.]+)"', svg)]


def test_larger_errors_stand_higher_and_numbers_by_their_size() -> None:
    """On a logarithmic scale where the axis is wide: 1, 10 and 100 are as far apart."""
    bands = tuple(Band(x, 0.5 * y, y, 2.0 * y) for x, y in ((1, 1.0), (10, 2.0), (100, 4.0)))
    svg = curves("error", "samples", "mm", [Line("ours", bands)]).svg
    assert heights(svg) == sorted(heights(svg), reverse=True)
    first, middle, last = places(svg)
    assert middle - first == pytest.approx(last - middle, abs=0.2)


def test_words_stand_side_by_side() -> None:
    """In their own order."""
    bands = tuple(Band(x, 1.0, 1.0, 1.0) for x in ("b", "a", "c"))
    svg = curves("error", "board", "mm", [Line("", bands)]).svg
    assert places(svg) == sorted(places(svg))
    assert svg.index(">b<") < svg.index(">a<") < svg.index(">c<")


def test_a_line_is_broken_where_there_is_no_answer() -> None:
    """Three points of four, in two runs; a figure without any answer is a figure."""
    bands = (Band(10, 1.0, 2.0, 3.0), NONE, Band(30, 1.0, 2.0, 3.0), Band(40, 1.0, 2.0, 3.0))
    svg = curves("error", "samples", "mm", [Line("", bands)]).svg
    assert (len(heights(svg)), svg.count('class="median"')) == (3, 2)
    assert heights(curves("error", "samples", "mm", [Line("", (NONE,))]).svg) == []
