"""Tests of polar plots of residuals and orientations."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.drawings import check_labels, ends, labels, view
from tests.seen_points import seen

from basecal.accuracy.fit_details import ViewPoses
from basecal.geometry import SE3
from basecal.reporting.figures.rings import (
    MIDDLE,
    RADIUS,
    orientation_figure,
    place_on_rings,
    polar_drawing,
    residual_polar,
)


def test_points_are_placed_on_rings():
    """Points are placed at the centre, half-way out, and on the outer ring if they are beyond it."""
    at = place_on_rings(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 8.0]]), 2.0)
    np.testing.assert_allclose(at, [[MIDDLE, MIDDLE], [MIDDLE + RADIUS / 2, MIDDLE], [MIDDLE, MIDDLE + RADIUS]])


def test_rings_are_labelled():
    """Each ring is a circle with its label, escaped."""
    svg = polar_drawing("x", [(0.5, "1 <px>"), (1.0, "2 px")])
    assert svg.count("<circle") == 2
    assert "1 &lt;px&gt;" in svg


def test_dots_are_at_their_residuals():
    """The centre of the cloud is the mean residual, with u to the right and v downwards."""
    off = np.random.default_rng(1).normal([0.5, 0.2], 0.1, (200, 2))
    figure = residual_polar(seen(np.zeros((200, 2)), off))
    cloud = re.search(r'class="cloud" d="([^"]*)"', figure.svg)[1]
    at = np.array([list(map(float, each.split())) for each in re.findall(r"M(\S+ \S+?)h0", cloud)])
    assert len(at) == 200
    right, down = at.mean(0) - 166.0
    assert right > 2 * down > 0
    assert "50 % are below 0.5" in figure.caption


def test_many_residuals_are_thinned():
    """Of 6000 points 1500 are drawn, and the caption states it. Long residuals are on the outer ring."""
    off = np.random.default_rng(1).normal(0, 0.2, (6000, 2))
    off[0] = 1e3, 0
    figure = residual_polar(seen(np.zeros((6000, 2)), off))
    drawn = re.search(r'class="cloud" d="([^"]*)"', figure.svg)[1]
    assert drawn.count("M") == 1500
    assert "1500 of 6000 points drawn" in figure.caption


def test_excluded_residuals_are_marked():
    """Excluded residuals are counted and drawn separately, and do not widen the rings."""
    points = seen(np.zeros((4, 2)), [[0.1, 0], [0, 0.1], [-0.1, 0], [30, 0]], [True, True, True, False])
    figure = residual_polar(points)
    assert "Orange, left out: 1 point." in figure.caption
    assert ">0.25 px<" in figure.svg


def views(*tilts_deg, front=1.0):
    """Views from half a metre, tilted about y."""
    angles = np.radians(tilts_deg)
    away = np.stack([np.sin(angles), 0 * angles, front * np.cos(angles)], -1)
    turn = np.stack([0 * angles, angles, 0 * angles], -1)
    target_from_camera = SE3.from_rotvec(turn, 0.5 * away)
    return ViewPoses("wrist", "board", np.arange(len(tilts_deg)), target_from_camera.inverse())


@pytest.mark.parametrize("front", [1.0, -1.0])
def test_tilts_are_independent_of_front_side(front):
    """A frontal view is at the centre, and 25 degrees is inside of the ring of 30."""
    figure = orientation_figure(views(0, 10, 25, front=front))
    assert "Tilts of 0° to 25°" in figure.caption
    assert "sample 2: tilted by 25 deg" in figure.svg
    assert ">30°<" in figure.svg
    assert figure.svg.count('class="mark view"') == 3


def test_views_from_all_sides_have_rings_to_180_deg():
    """Views from the back extend the rings to 180 degrees."""
    assert ">180°<" in orientation_figure(views(0, 20, 170)).svg


def test_many_views_are_thinned():
    """At most 400 views are drawn."""
    assert orientation_figure(views(*np.linspace(0, 20, 1000))).svg.count('class="mark view"') <= 400


def test_polar_axes_and_ring_labels():
    """Two axes cross at the centre over the whole plot, and each label is just above the top of its ring."""
    svg = polar_drawing("x", [(0.5, "1 px"), (1.0, "2 px")])
    check_labels(svg)
    across, down = ends(svg, "ring")
    assert across.tolist() == [[MIDDLE - RADIUS, MIDDLE], [MIDDLE + RADIUS, MIDDLE]]
    assert down.tolist() == [[MIDDLE, MIDDLE - RADIUS], [MIDDLE, MIDDLE + RADIUS]]
    assert view(svg)[:4] == (0, 0, 2 * MIDDLE, 2 * MIDDLE)
    circles = [[float(each) for each in found] for found in re.findall(r'cx="(.*?)" cy="(.*?)" r="(.*?)"', svg)]
    assert circles == [[MIDDLE, MIDDLE, RADIUS / 2], [MIDDLE, MIDDLE, RADIUS]]
    for box, share in zip(labels(svg), (0.5, 1.0), strict=True):
        assert MIDDLE < box.left < MIDDLE + 8
        assert box.bottom <= MIDDLE - share * RADIUS < box.bottom + 8


def test_rings_and_percentiles_of_residuals():
    """Of lengths from 0.01 to 1 px, 50 % are below 0.51 and 95 % below 0.95. The outer ring is 2 px, above 2.5 rms."""
    off = np.stack([np.arange(1, 101) / 100, np.zeros(100)], axis=-1)
    figure = residual_polar(seen(np.zeros((100, 2)), off))
    assert figure.caption.startswith("50 % are below 0.51 px, 95 % below 0.95 px. A cloud")
    assert [label.text for label in labels(figure.svg)] == ["1 px", "2 px"]


def test_longer_residuals_are_counted():
    """One of fifty is beyond the ring.

    All are drawn, so that the caption mentions neither thinning nor excluded points.
    """
    off = np.full((50, 2), 0.1)
    off[0] = 5, 0
    figure = residual_polar(seen(np.zeros((50, 2)), off))
    assert " Longer, drawn on the outer ring: 1 residual." in figure.caption
    assert "points drawn" not in figure.caption
    assert "orange" not in figure.caption


def places(figure):
    """Positions of the marks from the plot's centre, and directions and centres of their lines."""
    circles = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="3"', figure.svg)
    lines = re.findall(r'<path d="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)"', figure.svg)
    along = np.array(lines, float).reshape(-1, 2, 2)
    return np.array(circles, float) - MIDDLE, along[:, 1] - along[:, 0], along.mean(1) - MIDDLE


def test_marks_show_tilt_and_camera_x_axis():
    """A tilt of 15 degrees towards x is half of the radius of 30.

    The line of 12 px is along the camera's x axis about its mark.
    """
    at, along, middles = places(orientation_figure(views(0, 15, 30)))
    np.testing.assert_allclose(at, [[0, 0], [RADIUS / 2, 0], [RADIUS, 0]], atol=0.06)
    np.testing.assert_allclose(middles, at, atol=0.06)
    np.testing.assert_allclose(along, [[12, 0]] * 3, atol=0.11)


@pytest.mark.parametrize(("tilt", "names"), [(30, "10 20 30"), (31, "20 40 60"), (61, "30 60 90"), (91, "60 120 180")])
def test_ring_labels_are_thirds(tilt, names):
    """The outer ring is the next of 30, 60, 90 and 180 degrees."""
    figure = orientation_figure(views(0, 0, tilt - 1e-9))
    assert [label.text for label in labels(figure.svg)] == [f"{each}°" for each in names.split()]


@pytest.mark.parametrize(("given", "tilts"), [((0, 0, 180, 180), [0, 0, 180, 180]), ((0, 180, 180), [180, 0, 0])])
def test_front_is_the_side_of_most_views(given, tilts):
    """The front is the side of positive z if half of the views are there."""
    svg = orientation_figure(views(*given)).svg
    assert [int(each) for each in re.findall(r"tilted by (\d+) deg", svg)] == tilts


@pytest.mark.parametrize(("count", "drawn"), [(1500, 1500), (1501, 751)])
def test_up_to_1500_residuals_are_drawn(count, drawn):
    """Every second of 1501 is drawn; of excluded residuals, the first 1500."""
    off = np.random.default_rng(1).normal(0, 0.1, (2 * count, 2))
    figure = residual_polar(seen(np.zeros((2 * count, 2)), off, [True] * count + [False] * count))
    clouds = dict(re.findall(r'class="(cloud|left-out)" d="([^"]*)"', figure.svg))
    assert (clouds["cloud"].count("M"), clouds["left-out"].count("M")) == (drawn, 1500)
    assert ("points drawn" in figure.caption) == (drawn < count)


def test_up_to_400_views_are_drawn():
    """Every second of 401 views is drawn."""
    for count, drawn in ((400, 400), (401, 201)):
        assert orientation_figure(views(*np.linspace(0, 20, count))).svg.count('class="mark view"') == drawn
