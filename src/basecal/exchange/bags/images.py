"""Conversion of images in a bag to files: compressed images unchanged, raw images lossless as PGM or PPM.

Source: sensor_msgs/image_encodings.hpp; netpbm's pages of PGM and PPM.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from basecal.errors import InputError, list_names
from basecal.exchange.bags.bag import COMPRESSED, Message

_MAGIC = {b"\xff\xd8\xff": ".jpg", b"\x89PNG": ".png"}


class _Layout(NamedTuple):
    """Memory layout of pixels: bytes per channel, channels, and the indices of red, green and blue, or of grey."""

    depth: int
    channels: int
    indices: tuple[int, ...]


_GREY, _COLOUR, _REVERSED = (0,), (0, 1, 2), (2, 1, 0)
_BAYER, _ORDERS = "bayer", ("rggb", "bggr", "gbrg", "grbg")
_LAYOUTS = {
    "mono8": _Layout(1, 1, _GREY),
    "8UC1": _Layout(1, 1, _GREY),
    "mono16": _Layout(2, 1, _GREY),
    "16UC1": _Layout(2, 1, _GREY),
    "rgb8": _Layout(1, 3, _COLOUR),
    "rgba8": _Layout(1, 4, _COLOUR),
    "bgr8": _Layout(1, 3, _REVERSED),
    "8UC3": _Layout(1, 3, _REVERSED),
    "bgra8": _Layout(1, 4, _REVERSED),
    "8UC4": _Layout(1, 4, _REVERSED),
    "rgb16": _Layout(2, 3, _COLOUR),
    "bgr16": _Layout(2, 3, _REVERSED),
    **{f"{_BAYER}_{order}8": _Layout(1, 1, _GREY) for order in _ORDERS},
    **{f"{_BAYER}_{order}16": _Layout(2, 1, _GREY) for order in _ORDERS},
    # The luma channel of YUV.
    "yuv422": _Layout(1, 2, (1,)),
    "uyvy": _Layout(1, 2, (1,)),
    "yuv422_yuy2": _Layout(1, 2, _GREY),
    "yuyv": _Layout(1, 2, _GREY),
}


class ImageFile(NamedTuple):
    """Extension and content of an image file."""

    ending: str
    content: bytes


def image_file(message: Message, path: str) -> ImageFile:
    """Convert an image message to a file.

    Args:
        message: An Image or a CompressedImage.
        path: Name of the bag in errors.

    Raises:
        InputError: if the encoding is not supported, or bytes are missing.
    """
    subject = f"{path}: {message.topic.name}"
    if message.topic.kind != COMPRESSED:
        return _netpbm(message.data, subject)
    content = bytes(message.data.data)
    ending = next((end for magic, end in _MAGIC.items() if content.startswith(magic)), None)
    if ending is None:
        raise InputError(f"{subject}: compressed as {message.data.format!r}, expected jpeg or png")
    return ImageFile(ending, content)


def _netpbm(image: Any, subject: str) -> ImageFile:
    layout = _LAYOUTS.get(image.encoding)
    if layout is None:
        raise InputError(f"{subject}: images are {image.encoding!r}; expected {list_names(list(_LAYOUTS))}")
    width, height, row = int(image.width), int(image.height), int(image.step)
    needed = width * layout.channels * layout.depth
    data = np.asarray(image.data, dtype=np.uint8)
    if row < needed or len(data) < row * height or not width or not height:
        raise InputError(f"{subject}: {len(data)} bytes for {width} x {height} pixels of {image.encoding}: is damaged")
    rows = np.ascontiguousarray(data[: row * height].reshape(height, row)[:, :needed])
    kind = np.dtype(np.uint8 if layout.depth == 1 else np.uint16).newbyteorder(">" if image.is_bigendian else "<")
    pixels = rows.view(kind).reshape(height, width, layout.channels)[..., layout.indices]
    if image.encoding.startswith(_BAYER):
        pixels = _brightness(pixels[..., 0])[..., None].astype(kind)
    is_grey = len(layout.indices) == 1
    head = f"P{5 if is_grey else 6}\n{width} {height}\n{256**layout.depth - 1}\n"
    content = pixels.astype(kind.newbyteorder(">")).tobytes()
    return ImageFile(".pgm" if is_grey else ".ppm", head.encode() + content)


def _brightness(mosaic: NDArray[np.integer[Any]]) -> NDArray[np.uint32]:
    """Grey image (h, w) of a Bayer mosaic (h, w): a quarter red, half green and a quarter blue at every pixel.

    Binomial weights of a 3 x 3 neighbourhood give each colour this share at every pixel, for any order of the mosaic.
    The weights are symmetric: edges are slightly blurred but not shifted.
    """
    wide = np.pad(mosaic.astype(np.uint32), 1, mode="reflect")  # reflection keeps the order of the colours
    rows = wide[:-2] + 2 * wide[1:-1] + wide[2:]
    grey: NDArray[np.uint32] = (rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:] + 8) // 16
    return grey
