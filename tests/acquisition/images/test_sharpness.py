"""Views judged beside the others of their cell."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.images.sharpness import Sharpness
from basecal.geometry import SE3
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.edge_width import EdgeWidth, edge_width
from shared.facing_arms import facing_arms

WORLD = facing_arms()
BOARD, LENS = WORLD.cell.targets["board"].target, WORLD.lenses["wrist"]
VIEW = ("wrist", "board")


def is_blurred(before, away_m=0.65, way=(0.0, 0.0), blur_px=0.5):
    """What is thought of an image of the board from so far, moved and blurred so much while it is exposed."""
    settings = RenderSettings(blur_px=blur_px)
    at = SE3(np.eye(3), np.array([0.0, 0.0, away_m]) - BOARD.points.mean(0))
    pixels = LENS.project(at @ BOARD.points)
    image = expose(blur_motion(radiance(LENS, [(BOARD, at)], settings), np.array(way)), settings, 0)
    return before.is_blurred(VIEW, edge_width(image, pixels), pixels, BOARD.points)


@pytest.mark.parametrize("blur_px", [0.5, 4.0])
def test_softness_is_no_motion(blur_px):
    """A lens that is as soft everywhere passes, be it sharp or out of focus by a point spread of 4 px."""
    before = Sharpness()
    assert not any(is_blurred(before, away_m, blur_px=blur_px) for away_m in (0.7, 0.5))


def test_motion_along_an_edge_is_seen_at_once():
    """Four pixels of motion across one family of edges are too many, in the first image as well."""
    assert is_blurred(Sharpness(), way=(4.0, 0.0))


def test_motion_across_all_edges_is_seen_beside_a_sharp_view():
    """What widens all edges alike is not focus if another view is sharper; it does not count as a view itself."""
    before = Sharpness()
    assert not is_blurred(before)
    assert is_blurred(before, way=(4.0, 4.0))
    assert not is_blurred(before, 0.6)


def test_edges_of_a_soft_print_are_wider_from_near():
    """Edges as wide on the paper in each view are the print's; wider ones are not."""
    points, before = np.array([[0.0, 0, 0], [0.1, 0.1, 0]]), Sharpness()
    for scale, wide_px, blurred in ((1000.0, 6.0, False), (3000.0, 18.0, False), (1000.0, 18.0, True)):
        pixels = scale * points[:, :2]
        assert before.is_blurred(VIEW, EdgeWidth(wide_px, wide_px), pixels, points) == blurred


def test_one_point_has_no_size():
    """The only corner in view says nothing of the scale: it is not blurred, and no later view is compared with it."""
    before = Sharpness()
    assert not before.is_blurred(VIEW, EdgeWidth(3.0, 9.0), np.zeros((1, 2)), np.zeros((1, 3)))
    assert is_blurred(before, way=(4.0, 0.0))
