"""Chessboards: OpenCV finds the grid, each corner is then refined in the image.

A board looks the same after half a turn if its numbers of inner corners are both even or both odd. If the numbers are
equal, the board looks the same after a quarter turn. Ids may then count from either end, which only all views of a
recording together determine. Otherwise ids count from the corner whose outer square is black.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.geometry import Array
from basecal.vision.detection import Detection, Image, eight_bit, make_detection
from basecal.vision.fit.corner_shapes import saddle
from basecal.vision.fit.corners import BOARD_ARM_PX, Corners, Window, refine_corners
from basecal.vision.fit.local_map import grid_axes, orient_grid
from basecal.vision.kinds.preprocessing import Preprocessing

_FEWEST_CORNERS = 3  # corners per side of the smallest board that OpenCV searches
# Fastest first, with OpenCV's flags. Normalisation helps with uneven light, but loses boards in even light. Half scale
# takes a quarter of the time; if it misses a corner, the full scale is searched.
_PREPROCESSINGS = (
    (Preprocessing(0.5), 0),
    (Preprocessing(0.5), cv2.CALIB_CB_NORMALIZE_IMAGE),
    (Preprocessing(1.0), 0),
    (Preprocessing(1.0), cv2.CALIB_CB_NORMALIZE_IMAGE),
    (Preprocessing(2.0, stretched=True), 0),
)
_LEAST_SHARE = 0.5  # of the corners
_ARM_SQUARES = 0.7  # squares, which excludes the next corner and its blur
_CORNER_WINDOW = Window(
    arm_px=BOARD_ARM_PX, arm=_ARM_SQUARES, inside=_ARM_SQUARES, outside=_ARM_SQUARES, before=_ARM_SQUARES
)


def detect(image: Image, target: Target) -> Detection | None:
    """Detect the inner corners of a chessboard, row-major; None if the board is not entirely visible.

    Args:
        image: (h, w), uint8 or uint16.
        target: The board.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the board has too few corners.
    """
    columns, rows = target.options["corners"]
    if min(columns, rows) < _FEWEST_CORNERS:
        raise InputError(
            f"a chessboard of {columns} x {rows} inner corners cannot be found; expected {_FEWEST_CORNERS} or more"
        )
    fitted: Corners | None = None
    for preprocessing, corners in _grids(eight_bit(image), (columns, rows)):
        grid = orient_grid(corners.reshape(rows, columns, 2))
        candidate = refine_corners(image, saddle, grid.reshape(-1, 2), grid_axes(grid), _CORNER_WINDOW)
        if fitted is None or candidate.trusted.sum() > fitted.trusted.sum():
            fitted = candidate
        if preprocessing.scale >= 1 or fitted.trusted.all():
            break
    # On a board with marks in its squares, such as a ChArUco board, few corners can be trusted.
    if fitted is None or fitted.trusted.sum() < _LEAST_SHARE * len(target.ids):
        return None
    row, column = np.indices((rows, columns))
    # Gains with the sign of the first corner: positive if its outer square is bright.
    outward = fitted.gain.reshape(rows, columns) * (-1.0) ** (row + column)
    is_reversed = (columns + rows) % 2 and np.median(outward) > 0
    ids, kept = target.ids[::-1] if is_reversed else target.ids, fitted.trusted
    return make_detection(ids[kept], fitted.pixels[kept], fitted.sigma_px[kept])


def _grids(image: NDArray[np.uint8], size: tuple[int, int]) -> Iterator[tuple[Preprocessing, Array]]:
    """OpenCV's corners, (n, 2) [px], from each way that finds all of them; only the first way of each scale."""
    scale = 0.0
    for preprocessing, flags in _PREPROCESSINGS:
        if preprocessing.scale != scale and preprocessing.suits(image):
            is_found, corners = cv2.findChessboardCornersSB(preprocessing.apply(image), size, flags=flags)
            if is_found:
                scale = preprocessing.scale
                yield preprocessing, preprocessing.original_pixels(corners)
