"""Tests of curves with bands."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from tests.drawings import check_labels, ends, labels, view

from basecal.reporting.figures.curves import Band, curves

NONE = Band(20, None)


def heights(svg: str) -> list[float]:
    return [float(y) for y in re.findall(r'<circle cx="[\d.]+" cy="([\d.]+)"', svg)]


def places(svg: str) -> list[float]:
    return [float(x) for x in re.findall(r'<circle cx="([\d.]+)"', svg)]


def test_larger_errors_are_higher_on_log_axis() -> None:
    """A wide axis is logarithmic: 1, 10 and 100 are evenly spaced."""
    bands = tuple(Band(x, (0.5 * y, y, 2.0 * y)) for x, y in ((1, 1.0), (10, 2.0), (100, 4.0)))
    svg = curves("error", "samples", "mm", {"ours": bands})
    assert heights(svg) == sorted(heights(svg), reverse=True)
    first, middle, last = places(svg)
    assert middle - first == pytest.approx(last - middle, abs=0.2)


def test_words_on_axis_keep_their_order() -> None:
    """Words on an axis are side by side in their given order."""
    bands = tuple(Band(x, (1.0, 1.0, 1.0)) for x in ("b", "a", "c"))
    svg = curves("error", "board", "mm", {"": bands})
    assert places(svg) == sorted(places(svg))
    assert svg.index(">b<") < svg.index(">a<") < svg.index(">c<")


def test_long_axis_labels_are_wrapped() -> None:
    """No line is wider than its column on a narrow screen. The text is complete, and the drawing is higher."""
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


def test_line_is_interrupted_at_missing_values() -> None:
    """Three of four points are drawn in two parts. A figure without any value is valid."""
    bands = (Band(10, (1.0, 2.0, 3.0)), NONE, Band(30, (1.0, 2.0, 3.0)), Band(40, (1.0, 2.0, 3.0)))
    svg = curves("error", "samples", "mm", {"": bands})
    assert (len(heights(svg)), svg.count('class="median"')) == (3, 2)
    assert heights(curves("error", "samples", "mm", {"": (NONE,)})) == []


def test_labels_of_many_positions_are_thinned() -> None:
    """Forty dates of a month have a rule each, and as many readable labels as fit, including the first."""
    bands = tuple(Band(0.75 * k, (1.0, 1.5, 2.0)) for k in range(40))
    svg = curves("shift", "days", "mm", {"": bands})
    labels = [float(x) for x in re.findall(r'<text class="tick" x="([\d.]+)"[^>]*text-anchor="middle"', svg)]
    assert len(places(svg)) == 40
    assert labels[0] == pytest.approx(places(svg)[0])
    assert min(b - a for a, b in pairwise(labels)) >= 36
    assert len(labels) > 10


@pytest.mark.parametrize("most", [1.05, 1.3, 2.4, 5.0, 9.9, 0.02])
def test_axis_has_at_least_four_round_numbers(most: float) -> None:
    """The axis has at least four round numbers, whatever the largest error."""
    svg = curves("error", "days", "mm", {"": (Band(0, (0.0, 0.5 * most, most)), Band(1, (0.0, 0.0, most)))})
    upwards = [float(label) for label in re.findall(r'text-anchor="end"[^>]*>([\d.e-]+)<', svg)]
    assert 4 <= len(upwards) <= 13
    step = upwards[1] - upwards[0]
    assert any(step == pytest.approx(share * 10.0**d) for share in (1, 2, 5) for d in range(-4, 2))


def test_labels_and_points_are_within_the_drawing() -> None:
    """All labels are readable. Points, bands and rules are between the axis and the right border."""
    bands = tuple(Band(x, (0.5 * y, y, 2.0 * y)) for x, y in ((1, 1.0), (10, 2.0), (100, 4.0)))
    for drawn in (bands, tuple(replace_at(band, f"{band.axis_value} samples of a board") for band in bands)):
        svg = curves("error", "samples", "mm", {"ours": drawn}, 1.5)
        check_labels(svg)
        assert 0 < view(svg).bottom - max(label.bottom for label in labels(svg)) < 40
        rules = np.concatenate(ends(svg, "rule"))
        low, high = rules.min(0), rules.max(0)
        inside = np.concatenate([each for kind in ("band", "whisker", "level") for each in ends(svg, kind)])
        assert np.all(inside >= low - 0.1)
        assert np.all(inside <= high + 0.1)
        assert high[0] < view(svg).right
        upwards = [label for label in labels(svg) if label.right < low[0]]
        assert len(upwards) >= 4
        below = [label for label in labels(svg) if label.top > high[1]]
        assert len(upwards) + len(below) == len(labels(svg))
        middles = [(label.left + label.right) / 2 for label in below]
        np.testing.assert_allclose(middles, places(svg), atol=0.1)


def replace_at(band: Band, at: str) -> Band:
    return band._replace(axis_value=at)


def test_bands_and_whiskers_span_quantiles() -> None:
    """The band passes the upper ends and returns along the lower ones; the median line connects the points."""
    bands = (Band(0, (1.0, 2.0, 3.0)), Band(1, (2.0, 3.0, 5.0)))
    svg = curves("error", "days", "mm", {"": bands}, logarithmic=False)
    (band,), (median,) = ends(svg, "band"), ends(svg, "median")
    assert median.tolist() == [list(each) for each in zip(places(svg), heights(svg), strict=True)]
    bottoms, tops = ([whisker[k, 1] for whisker in ends(svg, "whisker")] for k in (0, 1))
    assert band[:, 1].tolist() == [*tops, *bottoms[::-1]]
    per_mm = bottoms[0] - heights(svg)[0]
    np.testing.assert_allclose(
        [bottoms[0] - bottoms[1], tops[0] - tops[1], per_mm], [per_mm, 2 * per_mm, per_mm], atol=0.2
    )
    assert per_mm > 30


def test_point_title_has_position_and_median() -> None:
    """A line has its own class, and at most six have different colours."""
    lines = {f"l{k}": (Band(10, (1.0, 2.0, 3.0)), Band(20, (1.0, 2.0, 3.0))) for k in range(7)}
    svg = curves("error", "samples", "mm", lines)
    assert "<title>samples 10: 2.0 mm</title>" in svg
    assert re.findall(r'class="(line-\d)"', svg) == [f"line-{k}" for k in (0, 1, 2, 3, 4, 5, 0)]


def test_truth_values_have_columns() -> None:
    """Truth values have columns of equal width, not positions on a scale."""
    svg = curves("error", "joints", "mm", {"": [Band(each, (1.0, 1.0, 1.0)) for each in (True, False)]})
    middle = (62 + 640 - 14) / 2
    width = 640 - 62 - 14
    np.testing.assert_allclose(places(svg), [middle - width / 4, middle + width / 4], atol=0.06)


def test_drawing_is_half_as_high_as_wide() -> None:
    """The curves fill most of the drawing, which is about half as high as wide."""
    svg = curves("error", "days", "mm", {"": (Band(0, (1.0, 2.0, 3.0)), Band(1, (2.0, 3.0, 5.0)))})
    whole, rules = view(svg), np.concatenate(ends(svg, "rule"))
    assert 0.35 < whole.bottom / whole.right < 0.6
    assert np.all(np.ptp(rules, axis=0) > 0.75 * np.array([whole.right, whole.bottom]))
    assert np.ptp(heights(svg)) > 0.15 * whole.bottom
