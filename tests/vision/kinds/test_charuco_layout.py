"""Squares of a board by where its markers stand."""

from __future__ import annotations

import pytest

from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3
from basecal.vision.kinds.charuco_layout import likely_boards
from vision_scenes import STRAIGHT, TARGETS, scene, shrunk

LEANT = SE3.from_rpy((0.1, 0.1, -0.2), (0.0, 0.0, 0.55))


def layout(board):
    of = board.options
    return of["squares"], of["legacy_pattern"], of["dictionary"]


@pytest.mark.parametrize(
    ("printed", "stated"),
    [
        ("charuco", charuco_target((12, 3), 0.04, 0.03, "DICT_4X4_100")),
        ("legacy", charuco_target((4, 4), 0.04, 0.03, "DICT_5X5_50")),
    ],
)
def test_the_printed_board_comes_first(printed, stated):
    """Whatever is stated, seen from the front and leant; of the dictionary stated, which has enough markers."""
    images = [shrunk(scene(TARGETS[printed], pose=pose), 2) for pose in (STRAIGHT, LEANT)]
    (squares, legacy, dictionary) = layout(next(likely_boards(images, stated)))
    of = TARGETS[printed].options
    assert (squares, legacy) == (of["squares"], of["legacy_pattern"])
    assert dictionary == stated.options["dictionary"]


def test_without_markers_there_is_no_board():
    """Neither in images of a chessboard, nor of a dictionary that begins as no other."""
    assert list(likely_boards([scene(TARGETS["chessboard"])], TARGETS["charuco"])) == []
    alone = charuco_target((5, 7), 0.04, 0.03, "DICT_ARUCO_MIP_36H12")
    assert list(likely_boards([scene(TARGETS["charuco"])], alone)) == []
