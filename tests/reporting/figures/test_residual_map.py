"""Tests of the map of residuals over the image."""

from __future__ import annotations

import re

import numpy as np
from tests.drawings import check_labels, ends, labels, rectangles
from tests.seen_points import seen

from basecal.reporting.figures.residual_map import residual_map

THREE = [[10.0, 10.0], [20.0, 10.0], [30.0, 10.0]]


def test_squares_have_rms_and_mean_arrow():
    """Three points off by (3, 4) px in one square have an rms per coordinate of 3.54 px.

    Their arrow points to the lower right.
    """
    figure = residual_map((1280, 720), seen(THREE, [[3.0, 4.0]] * 3))
    assert "3 points, rms 3.5 px per coordinate" in figure.svg
    x, y, to_x, to_y = map(float, re.search(r'class="arrows" d="M(\S+) (\S+)L(\S+) ([0-9.]+)', figure.svg).groups())
    assert abs((to_x - x) / (to_y - y) - 0.75) < 0.02
    assert "3 points" in figure.caption


def test_arrow_heads_are_shorter_than_arrows():
    """The only arrow fills most of its square of 40: a shaft, and two lines back from its tip."""
    figure = residual_map((1280, 720), seen(THREE, [[3.0, 4.0]] * 3))
    (lines,) = re.findall(r'class="arrows" d="([^"]*)"', figure.svg)
    shaft, *heads = np.array([float(number) for number in re.findall(r"[-0-9.]+", lines)]).reshape(-1, 2, 2)
    assert len(heads) == 2
    for back, end in heads:
        np.testing.assert_array_equal(end, shaft[1])
        assert np.linalg.norm(end - back) < 0.5 * np.linalg.norm(shaft[1] - shaft[0])


def test_excluded_points_have_no_effect():
    """An outlier is in no square and no rms."""
    points = seen([*THREE, [20.0, 12.0]], [[0.1, 0.0]] * 3 + [[50.0, 0.0]], [True] * 3 + [False])
    figure = residual_map((1280, 720), points)
    assert "3 points, rms 0.071 px" in figure.svg
    assert "50" not in figure.caption


def test_few_points_have_no_arrow():
    """The mean of two points is mostly noise: it has no arrow, and the ruler still has a length."""
    figure = residual_map((1280, 720), seen(THREE[:2], [[0.1, 0.0]] * 2))
    assert 'class="arrows" d=""' in figure.svg
    assert "nan" not in figure.svg


def test_zero_residuals_are_drawn():
    """Residuals of zero cause no division by zero."""
    assert "rms 0 px" in residual_map(None, seen(THREE, [[0.0, 0.0]] * 3)).svg


SIZE = (1280, 720)  # [px]: squares of 80 px, drawn with edges of 40


def test_arrow_length_matches_ruler():
    """A mean of 5 px fills 80 % of a square of 40, and the ruler of 5 px has the same length."""
    figure = residual_map(SIZE, seen(THREE, [[3.0, 4.0]] * 3))
    shaft = ends(figure.svg, "arrows")[0]
    (ruler,) = ends(figure.svg, "ruler")
    np.testing.assert_allclose(shaft, [[20, 20], [20 + 0.6 * 32, 20 + 0.8 * 32]], atol=0.05)
    assert np.ptp(ruler, axis=0).tolist() == [32, 0]
    assert "enlarged 12.8 times" in figure.caption
    assert labels(figure.svg)[0].text == "5 px"


def test_arrows_of_a_camera_have_one_scale():
    """Means of 2 and of 1 px have arrows in the scale of the ruler of 2 px."""
    right = [[1270.0, 10.0], [1260.0, 10.0], [1250.0, 10.0]]
    off = [[-2.0, 0.0]] * 3 + [[0.0, 1.0]] * 3
    figure = residual_map(SIZE, seen([*right, *THREE], off))
    shafts = [line for line in ends(figure.svg, "arrows") if np.ptp(line[:, 0]) == 0 or np.ptp(line[:, 1]) == 0]
    np.testing.assert_allclose(shafts, [[[20, 20], [20, 36]], [[620, 20], [588, 20]]], atol=0.05)
    shades = [float(box.text) for box in rectangles(figure.svg, "tile")]
    np.testing.assert_allclose(shades, [0.12 + 0.88 * 0.5**0.5 / 2, 0.12 + 0.88 * 2**0.5 / 2], atol=0.006)


def test_ruler_is_in_the_image_beside_its_label():
    """The ruler is at the lower left, clear of the strip below."""
    svg = residual_map(SIZE, seen(THREE, [[3.0, 4.0]] * 3)).svg
    check_labels(svg)
    (ruler,), label = ends(svg, "ruler"), labels(svg)[0]
    assert 0 < ruler[0, 0] < ruler[1, 0] < label.left < ruler[1, 0] + 20
    assert label.top < ruler[0, 1] < label.bottom < 360
    assert ruler[0, 1] > 330


def test_arrow_heads_are_symmetric():
    """The lines of a head extend 4 px along the shaft and 2 px beside it, from its tip."""
    shaft, *heads = ends(residual_map(SIZE, seen(THREE, [[3.0, 4.0]] * 3)).svg, "arrows")
    along = (shaft[1] - shaft[0]) / np.linalg.norm(shaft[1] - shaft[0])
    back = np.array([head[0] - shaft[1] for head in heads])
    np.testing.assert_allclose(back @ along, -4, atol=0.15)
    np.testing.assert_allclose(sorted(back @ [-along[1], along[0]]), [-2, 2], atol=0.15)


def test_short_arrows_have_no_head():
    """An arrow of 7.5 px has no head beside one of 32 px; an arrow of 8.5 px has one."""
    far = [[x + 320.0, y] for x, y in THREE]
    counts = []
    for length in (7.5, 8.5):
        off = [[10.0, 0.0]] * 3 + [[0.0, 10 * length / 32]] * 3
        counts.append(len(ends(residual_map(SIZE, seen([*THREE, *far], off)).svg, "arrows")))
    assert counts == [4, 6]


def test_ruler_fits_small_means():
    """Means of 0.03 and 0.04 px have a ruler of 0.05 px, which fills 80 % of a square."""
    figure = residual_map(SIZE, seen(THREE, [[0.03, 0.04]] * 3))
    assert labels(figure.svg)[0].text == "0.05 px"
    np.testing.assert_allclose(np.ptp(ends(figure.svg, "arrows")[0], axis=0), [19.2, 25.6], atol=0.05)
