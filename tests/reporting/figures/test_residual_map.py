"""Residuals over the image."""

from __future__ import annotations

import re

import numpy as np
from tests.seen_points import seen

from basecal.reporting.figures.residual_map import residual_map

THREE = [[10.0, 10.0], [20.0, 10.0], [30.0, 10.0]]


def test_squares_say_their_rms_and_arrows_go_where_points_are_predicted():
    """Three points off by (3, 4) px in one square: rms per coordinate 3.54 px, an arrow to the lower right."""
    figure = residual_map((1280, 720), seen(THREE, [[3.0, 4.0]] * 3))
    assert "3 points, rms 3.5 px per coordinate" in figure.svg
    x, y, to_x, to_y = map(float, re.search(r'class="arrows" d="M(\S+) (\S+)L(\S+) ([0-9.]+)', figure.svg).groups())
    assert abs((to_x - x) / (to_y - y) - 0.75) < 0.02
    assert "3 points" in figure.caption


def test_heads_of_arrows_are_shorter_than_arrows():
    """The only arrow fills most of its square of 40: a shaft, and two lines back from its tip."""
    figure = residual_map((1280, 720), seen(THREE, [[3.0, 4.0]] * 3))
    (lines,) = re.findall(r'class="arrows" d="([^"]*)"', figure.svg)
    shaft, *heads = np.array([float(number) for number in re.findall(r"[-0-9.]+", lines)]).reshape(-1, 2, 2)
    assert len(heads) == 2
    for back, end in heads:
        np.testing.assert_array_equal(end, shaft[1])
        assert np.linalg.norm(end - back) < 0.5 * np.linalg.norm(shaft[1] - shaft[0])


def test_what_was_left_out_moves_nothing():
    """An outlier is in no square and no rms."""
    points = seen([*THREE, [20.0, 12.0]], [[0.1, 0.0]] * 3 + [[50.0, 0.0]], [True] * 3 + [False])
    figure = residual_map((1280, 720), points)
    assert "3 points, rms 0.071 px" in figure.svg
    assert "50" not in figure.caption


def test_few_points_have_no_arrow():
    """The mean of two points is their noise: no arrow, and the ruler still has a length."""
    figure = residual_map((1280, 720), seen(THREE[:2], [[0.1, 0.0]] * 2))
    assert 'class="arrows" d=""' in figure.svg
    assert "nan" not in figure.svg


def test_exact_points_are_drawn():
    """Residuals of zero divide nothing by zero."""
    assert "rms 0 px" in residual_map(None, seen(THREE, [[0.0, 0.0]] * 3)).svg
