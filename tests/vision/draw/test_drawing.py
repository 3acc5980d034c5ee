"""Tests of the drawings of printed targets."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.led import led_target
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.vision.draw.drawing import Sheet, target_drawing
from basecal.vision.kinds.preprocessing import charuco_board
from vision_scenes import TARGETS


def is_black(sheet: Sheet, places: Array) -> Any:
    """Whether positions, (n, 2) [m], are black."""
    x, y = places[:, None, 0], places[:, None, 1]
    left, top, right, bottom = sheet.rectangles.T
    inside = ((x > left) & (x < right) & (y > top) & (y < bottom)).any(axis=1)
    return inside | (np.hypot(x - sheet.discs[:, 0], y - sheet.discs[:, 1]) < sheet.discs[:, 2]).any(axis=1)


@pytest.mark.parametrize(
    ("squares", "legacy"), [((5, 7), False), ((5, 7), True), ((6, 4), False), ((6, 4), True), ((5, 8), True)]
)
def test_charuco_drawing_matches_opencv(squares: tuple[int, int], legacy: bool) -> None:
    """A ChArUco board is black at the same places as OpenCV's own image of it, with and without the legacy pattern."""
    board = charuco_target(squares, 0.04, 0.02, "DICT_4X4_50", legacy)
    pitch = 120  # a cell of a marker is ten pixels
    image = charuco_board(board).generateImage((squares[0] * pitch, squares[1] * pitch))
    at = np.arange(5, max(squares) * pitch, 10)
    column, row = (grid.ravel() for grid in np.meshgrid(at[at < squares[0] * pitch], at[at < squares[1] * pitch]))
    places = np.stack([column + 0.5, row + 0.5], -1) * 0.04 / pitch
    (sheet,) = target_drawing(board)
    np.testing.assert_array_equal(is_black(sheet, places), image[row, column] == 0)


@pytest.mark.parametrize(
    ("family", "number", "dictionary"),
    [("tag36h11", 5, cv2.aruco.DICT_APRILTAG_36h11), ("DICT_6X6_250", 17, cv2.aruco.DICT_6X6_250)],
)
def test_tag_drawing_matches_opencv(family: str, number: int, dictionary: int) -> None:
    """A tag is drawn about its origin like OpenCV's image, x right and y down."""
    tag = apriltag_target(family, [(number, 0.08, SE3.identity())])
    image = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), number, 80)
    row, column = (each.ravel() for each in np.mgrid[0:80:2, 0:80:2])
    (sheet,) = target_drawing(tag)
    black = is_black(sheet, (np.stack([column, row], -1) + 0.5) * 0.001 - 0.04)
    np.testing.assert_array_equal(black, image[row, column] == 0)


@pytest.mark.parametrize("kind", ["charuco", "legacy", "chessboard"])
def test_board_points_are_square_corners(kind: str) -> None:
    """The four quadrants around each point of a board alternate between black and white."""
    shape = TARGETS[kind]
    (sheet,) = target_drawing(shape)
    step = 0.05 * sheet.pitch * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    around = np.stack([is_black(sheet, shape.points[:, :2] + each) for each in step], axis=1)
    assert np.all(around[:, 0] == around[:, 2])
    assert np.all(around[:, 1] == around[:, 3])
    assert np.all(around[:, 0] != around[:, 1])


def test_circles_are_centred() -> None:
    """Every point of a grid of circles is the centre of a disc that touches no other."""
    for kind in ("circles", "asymmetric"):
        shape = TARGETS[kind]
        (sheet,) = target_drawing(shape)
        np.testing.assert_allclose(sheet.discs[:, :2], shape.points[:, :2])
        apart = np.linalg.norm(shape.points[:, None] - shape.points, axis=2)[~np.eye(len(shape.points), dtype=bool)]
        assert apart.min() > 2 * sheet.discs[0, 2]


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (led_target(), "not printed"),
        (apriltag_target("tagStandard41h12", [(0, 0.1, SE3.identity())]), "tagStandard41h12"),
        (apriltag_target("tag16h5", [(30, 0.1, SE3.identity())]), "0 to 29"),
        (charuco_target((12, 9), 0.04, 0.03, "DICT_4X4_50"), "0 to 49"),
    ],
)
def test_undrawable_target_is_refused(shape: Target, message: str) -> None:
    """A target without a print, an unknown family and a number beyond the dictionary are input errors."""
    with pytest.raises(InputError, match=message):
        target_drawing(shape)
