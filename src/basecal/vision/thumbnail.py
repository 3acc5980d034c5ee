"""Thumbnails of images for reports."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.vision.image_file import grey_image

_JPEG_QUALITY = 70  # of JPEG, at which blocks begin to be visible at edges
_BRIGHT_PERCENT = 99.5  # percentile of a 16-bit image that is shown white, as images seldom use all bits


def thumbnail(data: bytes | str, size_px: tuple[int, int] | None, width: int) -> bytes | None:
    """A grey JPEG thumbnail of an image file; None if the image cannot be used.

    Args:
        data: Content of the file, or why it cannot be read.
        size_px: Required width and height; None for any.
        width: Largest width of the thumbnail; smaller images are not enlarged.
    """
    image = grey_image(data, size_px)
    if isinstance(image, str):
        return None
    if image.dtype == np.uint16:
        white = max(float(np.percentile(image, _BRIGHT_PERCENT)), 1.0)
        image = (np.minimum(image / white, 1.0) * 255).astype(np.uint8)
    scale = min(1.0, width / image.shape[1])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    is_encoded, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return jpeg.tobytes() if is_encoded else None
