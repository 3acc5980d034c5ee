"""ChArUco boards: OpenCV finds the markers and rough corners, each corner is then refined in the image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.geometry import Array, IntArray
from basecal.vision.detection import Detection, Image, eight_bit, make_detection
from basecal.vision.fit.corner_shapes import saddle
from basecal.vision.fit.corners import BOARD_ARM_PX, Window, refine_corners
from basecal.vision.fit.local_map import local_axes
from basecal.vision.kinds.preprocessing import (
    MARKER_PREPROCESSINGS,
    Grey,
    Preprocessing,
    best_result,
    charuco_board,
    marker_corners,
)

_ARM_SQUARES = 0.7  # squares, which excludes the next corner and its blur
_ENOUGH_SHARE = 0.7  # of the corners: with fewer the board may be blurred, dark or small, and other ways are tried


def detect(image: Image, target: Target) -> Detection | None:
    """Detect the corners of a ChArUco board, with OpenCV's ids; None if there are none.

    Args:
        image: (h, w), uint8 or uint16.
        target: The board.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the dictionary has too few markers.
    """
    rough = best_result(
        eight_bit(image),
        MARKER_PREPROCESSINGS,
        partial(_detect_rough, cv2.aruco.CharucoDetector(charuco_board(target))),
        _ENOUGH_SHARE * len(target.ids),
    )
    if rough is None:
        return None
    corner_points, marker_plane = target.points[rough.ids, :2], marker_corners(target)
    own = rough.marker_ids < len(marker_plane)  # OpenCV also lists markers that the board does not have
    marker_points = marker_plane[rough.marker_ids[own]].reshape(-1, 2)
    marker_pixels = rough.markers.reshape(-1, 4, 2)[own].reshape(-1, 2)
    plane = np.concatenate([corner_points, marker_points])
    pixels = np.concatenate([rough.corners, marker_pixels])
    pitch = float(target.options["square_m"])
    gap = (1 - target.options["marker_m"] / pitch) / 2
    window = Window(arm_px=BOARD_ARM_PX, arm=_ARM_SQUARES, inside=gap, outside=gap, before=1.0)
    fitted = refine_corners(image, saddle, rough.corners, local_axes(corner_points, plane, pixels, pitch), window)
    kept = fitted.trusted
    return make_detection(rough.ids[kept], fitted.pixels[kept], fitted.sigma_px[kept])


@dataclass(frozen=True, eq=False)
class _Rough:
    """Ids, (n,), and corners, (n, 2) [px]; ids of markers, (m,), and their corners, (4 m, 2) [px]."""

    ids: IntArray
    corners: Array
    marker_ids: IntArray
    markers: Array

    def __len__(self) -> int:
        return len(self.ids)


def _detect_rough(detector: Any, image: Grey, preprocessing: Preprocessing) -> _Rough:
    corners, ids, markers, marker_ids = detector.detectBoard(image)
    if ids is None or marker_ids is None:
        ids, corners, marker_ids, markers = (), (), (), ()
    pixels, marker_pixels = preprocessing.original_pixels(corners), preprocessing.original_pixels(markers)
    return _Rough(_numbers(ids), pixels, _numbers(marker_ids), marker_pixels)


def _numbers(ids: object) -> IntArray:
    return np.asarray(ids, dtype=np.int64).ravel()
