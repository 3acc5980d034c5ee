"""A small image of an image for people to look at."""

from __future__ import annotations

import cv2
import numpy as np

from basecal.vision.image_file import grey_image

_JPEG_QUALITY = 70  # of JPEG: where blocks begin to show on edges
_BRIGHT_PERCENT = 99.5  # of the pixels of an image of 16 bits, which seldom fills them, shown below white


def thumbnail(data: bytes | str, size_px: tuple[int, int] | None, width: int) -> bytes | None:
    """A JPEG of at most this width of the image in the bytes of a file, grey; None if that cannot be used.

    Args:
        data: What the file holds, or why it cannot be read.
        size_px: Width and height it has to have; None if any will do.
        width: Of the small image; a smaller image stays as it is.
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
    written, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return jpeg.tobytes() if written else None
