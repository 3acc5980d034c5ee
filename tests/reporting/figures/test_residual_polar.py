"""Residuals by direction."""

from __future__ import annotations

import re

import numpy as np
from tests.seen_points import seen

from basecal.reporting.figures.residual_polar import residual_polar


def test_dots_stand_where_residuals_go():
    """The middle of the cloud is the mean residual; right is right and down is down."""
    off = np.random.default_rng(1).normal([0.5, 0.2], 0.1, (200, 2))
    figure = residual_polar(seen(np.zeros((200, 2)), off))
    cloud = re.search(r'class="cloud" d="([^"]*)"', figure.svg)[1]
    at = np.array([list(map(float, each.split())) for each in re.findall(r"M(\S+ \S+?)h0", cloud)])
    assert len(at) == 200
    right, down = at.mean(0) - 166.0
    assert right > 2 * down > 0
    assert "50 % are below 0.5" in figure.caption


def test_many_points_are_thinned_and_long_ones_stand_on_the_ring():
    """Of 6000 at most 1500 are drawn, which is said, and none stands outside."""
    off = np.random.default_rng(1).normal(0, 0.2, (6000, 2))
    off[0] = 1e3, 0
    figure = residual_polar(seen(np.zeros((6000, 2)), off))
    drawn = re.search(r'class="cloud" d="([^"]*)"', figure.svg)[1]
    assert drawn.count("M") == 1500
    assert "1500 of 6000 points drawn" in figure.caption


def test_what_was_left_out_is_red_and_apart():
    """It is counted, drawn on its own, and does not widen the rings."""
    points = seen(np.zeros((4, 2)), [[0.1, 0], [0, 0.1], [-0.1, 0], [30, 0]], [True, True, True, False])
    figure = residual_polar(points)
    assert "1 orange ones were left out" in figure.caption
    assert ">0.25 px<" in figure.svg
