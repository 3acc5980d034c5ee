"""Intervals by axis."""

from __future__ import annotations

import re

import numpy as np

from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.decision.components import component_figure

ESTIMATE = PoseEstimate(SE3.identity(), np.diag([1e-6, 4e-6, 9e-6, 1, 1, 1]))


def test_intervals_are_as_long_as_their_sigmas() -> None:
    """To scale, with their lengths in words; red only what is beyond the tolerance."""
    figure = component_figure("hand_base", ESTIMATE, 3e-3)
    lengths = [float(found) for found in re.findall(r"v12m0-6H([0-9.]+)m", figure.svg)]
    middle = float(re.findall(r"M([0-9.]+) 0V", figure.svg)[0])
    shares = (np.array(lengths) - middle) / (lengths[0] - middle)
    np.testing.assert_allclose(shares, [1, 2, 3], atol=0.01)
    assert re.findall(r"± ([0-9.]+) mm", figure.svg) == ["2.0", "3.9", "5.9"]
    assert re.findall(r"interval (\w+)", figure.svg) == ["within", "beyond", "beyond"]
    assert "the tolerance, 3 mm" in figure.caption


def test_each_axis_has_its_row() -> None:
    """Three rows of 30, each with its axis, interval and number at one height."""
    figure = component_figure("hand_base", ESTIMATE, None)
    intervals = [float(found) + 6 for found in re.findall(r'interval within" d="M[0-9.]+ ([-0-9.]+)v12', figure.svg)]
    assert intervals == [15, 45, 75]
    words = re.findall(r'y="([-0-9.]+)"[^>]*>([xyz])<', figure.svg)
    assert [(axis, round(float(y)) // 30) for y, axis in words] == [("x", 0), ("y", 1), ("z", 2)]


def test_without_a_tolerance_nothing_is_shaded() -> None:
    """And nothing is red."""
    figure = component_figure("hand_base", ESTIMATE, None)
    assert "allowed" not in figure.svg
    assert "beyond" not in figure.svg
