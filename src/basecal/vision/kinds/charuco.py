"""ChArUco boards: OpenCV finds the markers and rough corners, each corner is then fitted in the image."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.vision.detection import Detection, Image, eight_bit, found
from basecal.vision.fit.corners import BOARD_ARM_PX, Window, refined
from basecal.vision.fit.local_map import local_axes
from basecal.vision.fit.shapes import saddle
from basecal.vision.kinds.fiducial import charuco_board, marker_corners

_ARM = 0.7  # squares: the next corner and its blur stay outside


def detect(image: Image, target: Target) -> Detection | None:
    """The corners of a ChArUco board, by OpenCV's ids, or None.

    Args:
        image: (h, w), uint8 or uint16.
        target: The board.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or the dictionary has too few markers.
    """
    detector = cv2.aruco.CharucoDetector(charuco_board(target))
    corners, ids, markers, marker_ids = detector.detectBoard(eight_bit(image))
    if ids is None or not len(ids):
        return None
    ids, start = ids.ravel(), corners.reshape(-1, 2).astype(np.float64)
    at = target.points[ids, :2]
    plane, pixels = at, start
    if marker_ids is not None and len(marker_ids):
        by_marker = marker_corners(target)[marker_ids.ravel()].reshape(-1, 2)
        plane, pixels = np.concatenate([at, by_marker]), np.concatenate([start, np.reshape(markers, (-1, 2))])
    pitch = float(target.options["square_m"])
    gap = (1 - target.options["marker_m"] / pitch) / 2
    window = Window(arm_px=BOARD_ARM_PX, arm=_ARM, inside=gap, outside=gap, before=1.0)
    fitted = refined(image, saddle, start, local_axes(at, plane, pixels, pitch), window)
    kept = fitted.trusted
    return found(ids[kept].astype(np.int64), fitted.pixels[kept], fitted.sigma_px[kept])
