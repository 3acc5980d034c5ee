"""Curves with bands."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest

from basecal.reporting.figures.curves import Band, curves

NONE = Band(20, None)


def heights(svg: str) -> list[float]:
    return [float(y) for y in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)"', svg)]


def places(svg: str) -> list[float]:
    return [float(x) for x in re.findall(r'<circle cx="([\d.]+)"', svg)]


def test_larger_errors_stand_higher_and_numbers_by_their_size() -> None:
    """On a logarithmic scale where the axis is wide: 1, 10 and 100 are as far apart."""
    bands = tuple(Band(x, (0.5 * y, y, 2.0 * y)) for x, y in ((1, 1.0), (10, 2.0), (100, 4.0)))
    svg = curves("error", "samples", "mm", {"ours": bands})
    assert heights(svg) == sorted(heights(svg), reverse=True)
    first, middle, last = places(svg)
    assert middle - first == pytest.approx(last - middle, abs=0.2)


def test_words_stand_side_by_side() -> None:
    """In their own order."""
    bands = tuple(Band(x, (1.0, 1.0, 1.0)) for x in ("b", "a", "c"))
    svg = curves("error", "board", "mm", {"": bands})
    assert places(svg) == sorted(places(svg))
    assert svg.index(">b<") < svg.index(">a<") < svg.index(">c<")


def test_long_words_are_wrapped_beside_each_other() -> None:
    """No line is wider than its column on a narrow screen; nothing is left out, and the drawing is higher."""
    names = ("charuco 5x7 0.03 0.022 DICT_4X4_50", "aprilgrid 3x3 0.06 0.3 tag36h11", "short", "chessboard 6x4 0.06")
    drawn = [curves("error", "board", "mm", {"": [Band(n, (1.0, 1.0, 1.0)) for n in s]}) for s in (names, "ab")]
    labels = re.findall(r'<text class="tick"[^>]*text-anchor="middle"><title>([^<]*)</title>(.*?)</text>', drawn[0])
    assert [title for title, _ in labels] == list(names)
    for title, inside in labels:
        lines = [line for line in re.split(r"<[^>]*>", inside) if line]
        assert " ".join(lines) == title
        assert max(map(len, lines)) * 11.5 <= (640 - 76) / len(names)
    high, usual = (float(re.findall(r'viewBox="0 0 640 ([\d.]+)"', svg)[0]) for svg in drawn)
    assert high >= usual + 2 * 22


def test_a_line_is_broken_where_there_is_no_answer() -> None:
    """Three points of four, in two runs; a figure without any answer is a figure."""
    bands = (Band(10, (1.0, 2.0, 3.0)), NONE, Band(30, (1.0, 2.0, 3.0)), Band(40, (1.0, 2.0, 3.0)))
    svg = curves("error", "samples", "mm", {"": bands})
    assert (len(heights(svg)), svg.count('class="median"')) == (3, 2)
    assert heights(curves("error", "samples", "mm", {"": (NONE,)})) == []


def test_labels_of_many_places_stand_apart() -> None:
    """Forty times of a month: a rule each, and as many labels as can be read, the first among them."""
    bands = tuple(Band(0.75 * k, (1.0, 1.5, 2.0)) for k in range(40))
    svg = curves("shift", "days", "mm", {"": bands})
    labels = [float(x) for x in re.findall(r'<text class="tick" x="([\d.]+)"[^>]*text-anchor="middle"', svg)]
    assert len(places(svg)) == 40
    assert labels[0] == pytest.approx(places(svg)[0])
    assert min(b - a for a, b in pairwise(labels)) >= 36
    assert len(labels) > 10


@pytest.mark.parametrize("most", [1.05, 1.3, 2.4, 5.0, 9.9, 0.02])
def test_an_axis_has_enough_numbers(most: float) -> None:
    """Four at the least, whatever the largest error: round ones."""
    svg = curves("error", "days", "mm", {"": (Band(0, (0.0, 0.5 * most, most)), Band(1, (0.0, 0.0, most)))})
    upwards = [float(label) for label in re.findall(r'text-anchor="end"[^>]*>([\d.e-]+)<', svg)]
    assert 4 <= len(upwards) <= 13
    step = upwards[1] - upwards[0]
    assert any(step == pytest.approx(share * 10.0**d) for share in (1, 2, 5) for d in range(-4, 2))
