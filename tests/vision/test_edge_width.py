"""Tests of the measured widths of edges in an image."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from basecal.geometry import SE3
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.edge_width import edge_width
from shared.facing_arms import facing_arms

WORLD = facing_arms()
BOARD, LENS = WORLD.cell.targets["board"].target, WORLD.lenses["wrist"]
AT = SE3(np.eye(3), np.array([0.0, 0.0, 0.65]) - BOARD.points.mean(0))
PIXELS = LENS.project(AT @ BOARD.points)


def width(way=(0.0, 0.0), **settings):
    chosen = RenderSettings(**settings)
    return edge_width(expose(blur_motion(radiance(LENS, [(BOARD, AT)], chosen), np.array(way)), chosen, 0), PIXELS)


def test_edges_of_sharp_board_are_narrow():
    """Edges of a sharp image, dark or bright, noisy or not, are 2 to 4 px wide."""
    assert 2 < width().narrow_px <= width().wide_px < 4
    assert 2 < width(white=90.0, black=40.0, noise=1.0).wide_px < 4


@pytest.mark.parametrize("way", [(6.0, 0.0), (0.0, 6.0), (5.0, 5.0)])
def test_motion_in_any_direction_widens_edges(way):
    """A motion of six pixels widens edges to more than 5 px, though edges along the motion stay sharp."""
    assert width(way).wide_px > 5


def test_only_motion_widens_edges_unequally():
    """Motion makes edges across it more than 1.5 times as wide as the others. Defocus widens all edges equally."""
    moved, soft = width((6.0, 0.0)), width(blur_px=3.0)
    assert moved.wide_px > 1.5 * moved.narrow_px
    assert soft.wide_px < 1.1 * soft.narrow_px


def test_defocus_widens_edges():
    """A point spread of 2 px widens edges to more than 5 px."""
    assert width(blur_px=2.0).narrow_px > 5


def test_plain_image_has_no_edge_width():
    """A plain image, or points outside of the image, have no edges."""
    plain = np.full((100, 100), 90, dtype=np.uint8)
    assert edge_width(plain, np.array([[50.0, 50.0]])) is None
    assert edge_width(plain, np.array([[500.0, 50.0]])) is None


def edge(turn, sigma, shape=(120, 160), at=(80.0, 60.0)):
    """A step of 100 levels, blurred by a Gaussian, in a direction."""
    x, y = np.meshgrid(np.arange(float(shape[1])) - at[0], np.arange(float(shape[0])) - at[1])
    return 100 + 100 * ndtr((x * np.cos(turn) + y * np.sin(turn)) / sigma)


BOX = np.array([[50.0, 30.0], [110.0, 90.0]])


@pytest.mark.parametrize("turn", [0.0, 0.7, np.pi / 2, 2.5, -0.4])
@pytest.mark.parametrize("sigma", [1.5, 3.0])
def test_gaussian_edge_is_3_5_sigma_wide(turn, sigma):
    """The width of a Gaussian edge is 3.5 sigma in any direction and polarity.

    The narrow and the wide widths are equal.
    """
    for turned in (turn, turn + np.pi):
        found = edge_width(edge(turned, sigma), BOX)
        assert found.narrow_px == pytest.approx(3.5 * sigma, rel=0.07)
        assert found.wide_px == pytest.approx(found.narrow_px, rel=0.05)


def test_widths_of_two_directions_are_distinguished():
    """A sharp vertical edge and an equally long soft horizontal one have separate widths."""
    image = edge(0.0, 1.5) + edge(np.pi / 2, 4.0)
    found = edge_width(image, BOX)
    assert found.wide_px == pytest.approx(4.0 / 1.5 * found.narrow_px, rel=0.15)


def test_only_edges_near_the_points_count():
    """Edges are measured up to ten pixels around the box of the points, as far as the image extends."""
    image = edge(0.0, 3.0)
    image[:, 130:] += 400 * (np.arange(30) >= 10)
    near, far = np.array([[60.0, 30.0], [100.0, 90.0]]), np.array([[60.0, 30.0], [130.5, 90.0]])
    assert edge_width(image, near).narrow_px == pytest.approx(10.5, rel=0.1)
    assert edge_width(image, far).narrow_px < 8
    beyond = edge_width(edge(0.0, 3.0), np.array([[-30.0, -20.0], [400.0, 300.0]]))
    assert beyond.wide_px == pytest.approx(10.5, rel=0.1)


def test_width_without_contrast_or_rows_is_none():
    """The width is None for a uniform image and for a part of fewer than three pixels."""
    assert edge_width(np.full((60, 80), 100, np.uint8), np.array([[20.0, 20.0], [40.0, 40.0]])) is None
    assert edge_width(edge(0.0, 1.5)[:2], np.array([[50.0, 0.0], [110.0, 1.0]])) is None
    assert edge_width(edge(0.0, 1.5)[:3], np.array([[50.0, 0.0], [110.0, 1.0]])) is not None
