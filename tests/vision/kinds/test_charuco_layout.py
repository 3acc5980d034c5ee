"""Tests of the layout of a ChArUco board derived from its markers."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3
from basecal.vision.kinds import charuco_layout
from basecal.vision.kinds.charuco_layout import likely_boards
from basecal.vision.kinds.preprocessing import marker_corners
from vision_scenes import STRAIGHT, TARGETS, scene, shrunk

BLANK = np.zeros((8, 8), np.uint8)
LEANT = SE3.from_rpy((0.1, 0.1, -0.2), (0.0, 0.0, 0.55))


def layout(board):
    of = board.options
    return of["squares"], of["legacy_pattern"], of["dictionary"]


@pytest.mark.journey
@pytest.mark.parametrize(
    ("printed", "stated"),
    [
        ("charuco", charuco_target((12, 3), 0.04, 0.03, "DICT_4X4_100")),
        ("legacy", charuco_target((4, 4), 0.04, 0.03, "DICT_5X5_50")),
    ],
)
def test_printed_board_is_the_best_candidate(printed, stated):
    """The printed board is found from frontal and tilted views, whatever is stated.

    It has the stated dictionary, which has enough markers.
    """
    images = [shrunk(scene(TARGETS[printed], pose=pose), 2) for pose in (STRAIGHT, LEANT)]
    (squares, legacy, dictionary) = layout(next(likely_boards(images, stated)))
    of = TARGETS[printed].options
    assert (squares, legacy) == (of["squares"], of["legacy_pattern"])
    assert dictionary == stated.options["dictionary"]


def test_images_of_other_markers_have_no_board():
    """Images of a chessboard have no candidates, nor does a dictionary that shares no markers with the printed one."""
    assert list(likely_boards([scene(TARGETS["chessboard"])], TARGETS["charuco"])) == []
    alone = charuco_target((5, 7), 0.04, 0.03, "DICT_ARUCO_MIP_36H12")
    assert list(likely_boards([scene(TARGETS["charuco"])], alone)) == []


def seen_markers(board, count, noise=0.0):
    """Numbers and corners of a board's first markers in an image, off by some noise [px]."""
    corners = marker_corners(board)[:count] / board.options["square_m"]
    rng = np.random.default_rng(0)
    pixels = 40 * corners[..., :2] + 100
    return np.arange(count), pixels + noise * rng.standard_normal((count, 1, 2))


@pytest.mark.parametrize(("count", "known"), [(5, False), (6, True)])
def test_layout_requires_six_markers(monkeypatch, count, known):
    """Six markers must be visible in one image."""
    monkeypatch.setattr(charuco_layout, "_MOST_COLUMNS", 7)
    monkeypatch.setattr(charuco_layout, "detect_markers", lambda *_: seen_markers(TARGETS["charuco"], count))
    assert bool(list(likely_boards([BLANK], TARGETS["charuco"]))) == known


def test_at_most_three_boards_are_tried(monkeypatch):
    """The best candidate comes first. With all seventeen markers it is the printed board."""
    board = TARGETS["charuco"]
    monkeypatch.setattr(charuco_layout, "_MOST_COLUMNS", 7)
    monkeypatch.setattr(charuco_layout, "detect_markers", lambda *_: seen_markers(board, 6, 3.0))
    assert len(list(likely_boards([BLANK], board))) <= 3
    monkeypatch.setattr(charuco_layout, "detect_markers", lambda *_: seen_markers(board, 17))
    (best, *_) = likely_boards([BLANK], board)
    assert layout(best)[:2] == (board.options["squares"], False)


def test_images_without_markers_have_no_board(monkeypatch):
    """There are no candidates without markers or without images."""
    monkeypatch.setattr(charuco_layout, "detect_markers", lambda *_: (np.zeros(0, int), np.zeros((0, 4, 2))))
    assert list(likely_boards([BLANK], TARGETS["charuco"])) == []
    assert list(likely_boards([], TARGETS["charuco"])) == []
