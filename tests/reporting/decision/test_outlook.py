"""The error over samples."""

from __future__ import annotations

import re

import numpy as np

from basecal.cell import ErrorMap
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.decision.outlook import component_figure, outlook_figure, workspace

OUTLOOK = [(0, 3e-3), (10, 1.5e-3), (40, 1e-3)]
ESTIMATE = PoseEstimate(SE3.identity(), np.diag([1e-6, 4e-6, 9e-6, 1, 1, 1]))


def test_points_fall_and_have_words() -> None:
    """Over the number of samples in all; the dashed line is the tolerance."""
    figure = outlook_figure(OUTLOOK, 12, 1.2e-3)
    heights = [float(found) for found in re.findall(r'cy="([0-9.]+)"', figure.svg)]
    assert heights == sorted(heights)
    limit = float(re.findall(r'class="level" d="M[0-9.]+ ([0-9.]+)H', figure.svg)[0])
    assert heights[1] < limit < heights[2]
    assert re.findall(r">(\d+)</text>", figure.svg)[-3:] == ["12", "22", "52"]
    assert figure.caption == "3.0 mm with 12, 1.0 mm with 52 samples. Dashed: the tolerance, 1.2 mm."


def test_without_a_tolerance_there_is_no_line() -> None:
    """And no word of it."""
    figure = outlook_figure(OUTLOOK, 12, None)
    assert "level" not in figure.svg
    assert "Dashed" not in figure.caption


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


def test_without_a_tolerance_nothing_is_shaded() -> None:
    """And nothing is red."""
    figure = component_figure("hand_base", ESTIMATE, None)
    assert "allowed" not in figure.svg
    assert "beyond" not in figure.svg


def test_a_drawing_for_each_height():
    """A square for each point, the largest error the darkest, x to the right and y upwards."""
    points = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.5, 1.0)])
    lengths = np.full(8, 1e-3)
    lengths[-1] = 2e-3
    low, high = workspace(ErrorMap(points, lengths, np.full(8, 0.01)))
    assert (low.title, high.title) == ("at z = 0.500 m", "at z = 1.000 m")
    assert low.svg.count("<rect") == high.svg.count("<rect") == 5
    assert (high.x, high.y) == (("x 0.00 m", "1.00 m"), ("y 2.00 m", "0.00 m"))
    darkest = high.svg[high.svg.index('fill-opacity="1.00"') - 100 :]
    assert 'x="40.0" y="0.0"' in darkest
    assert re.findall(r'class="contour-label"[^>]*>([^<]+)<', high.svg)[0] == "1.2"
    assert "contour" not in low.svg
    assert "(1.000, 2.000, 1.000) m: 2.0 mm and 0.57 deg" in high.svg
    assert "1.0 to 2.0 mm in all" in low.caption
    assert high.svg.count('class="tile worst"') == 1
    assert high.caption.endswith("Outlined: the worst place, 1.00, 2.00, 1.00 m.")
    assert "worst" not in low.svg + low.caption


def test_one_point():
    """A place alone, exact, is a square."""
    (only,) = workspace(ErrorMap(np.zeros((1, 3)), np.zeros(1), np.zeros(1)))
    assert only.x == ("x 0.00 m",)
    assert only.svg.count("<rect") == 2


def test_each_axis_has_its_row() -> None:
    """Three rows of 30, each with its axis, interval and number at one height."""
    figure = component_figure("hand_base", ESTIMATE, None)
    intervals = [float(found) + 6 for found in re.findall(r'interval within" d="M[0-9.]+ ([-0-9.]+)v12', figure.svg)]
    assert intervals == [15, 45, 75]
    words = re.findall(r'y="([-0-9.]+)"[^>]*>([xyz])<', figure.svg)
    assert [(axis, round(float(y)) // 30) for y, axis in words] == [("x", 0), ("y", 1), ("z", 2)]
