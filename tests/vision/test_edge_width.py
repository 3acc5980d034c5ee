"""How wide edges are."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_a_sharp_board_has_narrow_edges():
    """Edges of a sharp image, dark or bright, noisy or not, are 2 to 4 px wide."""
    assert 2 < width().narrow_px <= width().wide_px < 4
    assert 2 < width(white=90.0, black=40.0, noise=1.0).wide_px < 4


@pytest.mark.parametrize("way", [(6.0, 0.0), (0.0, 6.0), (5.0, 5.0)])
def test_motion_widens_them_in_any_direction(way):
    """Six pixels of motion make them wider than 5 px, though edges along it stay sharp."""
    assert width(way).wide_px > 5


def test_only_motion_widens_some_more_than_others():
    """Across one direction they are half as wide again as across the other; out of focus all are as wide."""
    moved, soft = width((6.0, 0.0)), width(blur_px=3.0)
    assert moved.wide_px > 1.5 * moved.narrow_px
    assert soft.wide_px < 1.1 * soft.narrow_px


def test_focus_widens_them():
    """So does a point spread of 2 px."""
    assert width(blur_px=2.0).narrow_px > 5


def test_nothing_to_measure():
    """A plain image, or points at its very border, have no edges."""
    plain = np.full((100, 100), 90, dtype=np.uint8)
    assert edge_width(plain, np.array([[50.0, 50.0]])) is None
    assert edge_width(plain, np.array([[500.0, 50.0]])) is None
