"""Images from files, grey, or a sentence why there is none; nothing a file holds is an error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.errors import InputError
from basecal.vision.detection import Image

_JPEG, _PNG, _BMP = b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM"
_TO_GREY = {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
_LARGEST_BYTES = 2**29  # 512 MiB: 16 bits and four channels of 64 megapixels
_END_BYTES = 64  # in which a whole PNG names its end; some programs write a little after it


def read_bytes(path: Path) -> bytes | str:
    """What a file holds, or why it cannot be read."""
    try:
        if not path.is_file():
            return "is missing" if not path.exists() else "is not a file"
        if path.stat().st_size > _LARGEST_BYTES:
            return f"has {path.stat().st_size / 2**20:.0f} MB, more than an image has"
        return path.read_bytes()
    except OSError as error:
        return f"cannot be read ({error.strerror})"


def grey_image(data: bytes, size_px: tuple[int, int] | None) -> Image | str:
    """The image in the bytes of a file, (h, w) of uint8 or uint16, colour turned to grey, or why there is none.

    Args:
        data: What the file holds.
        size_px: Width and height it has to have; None where any will do.
    """
    if not data:
        return "is empty"
    if _is_cut(data):
        return "is truncated"
    try:
        decoded = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        decoded = None
    if decoded is None:
        return "is not an image (PNG, JPEG, TIFF, BMP and the like)"
    pixels: NDArray[Any] = decoded
    size = (pixels.shape[1], pixels.shape[0])
    if size_px is not None and size != tuple(size_px):
        return f"has {size[0]} x {size[1]} pixels, its camera {size_px[0]} x {size_px[1]}"
    if pixels.dtype not in (np.uint8, np.uint16):
        return f"has pixels of type {pixels.dtype}, expected 8 or 16 bits"
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] not in _TO_GREY:
        return f"has {pixels.shape[2]} channels, expected grey or colour"
    return np.asarray(cv2.cvtColor(pixels, _TO_GREY[pixels.shape[2]]))


def write_png(path: Path, image: Image) -> None:
    """Write an image, (h, w), with the folders it needs.

    Raises:
        InputError: if it cannot be written.
    """
    written, data = cv2.imencode(".png", image)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
    if not written:
        raise InputError(f"{path} cannot be written: the image has type {image.dtype}")


def _is_cut(data: bytes) -> bool:
    """Whether the end of an image is missing; decoders fill it with grey and say so only on the terminal."""
    if data.startswith(_JPEG):
        return data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda")
    if data.startswith(_PNG):
        return b"IEND" not in data[-_END_BYTES:] and b"IEND\xaeB`\x82" not in data
    return data.startswith(_BMP) and len(data) < int.from_bytes(data[2:6], "little")
