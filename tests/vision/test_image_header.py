"""Headers of image files."""

from __future__ import annotations

import io
import struct

import cv2
import numpy as np
import pytest

from basecal.vision.image_header import Header, header
from vision_scenes import with_exif

IMAGE = np.random.default_rng(0).integers(0, 256, (48, 64)).astype(np.uint8)


def encoded(suffix: str, *settings: int) -> bytes:
    image = np.repeat(IMAGE[..., None], 3, axis=2) if suffix == ".webp" else IMAGE
    return bytes(cv2.imencode(suffix, image, list(settings))[1])


FILES = {
    "png": encoded(".png"),
    "jpeg": encoded(".jpg"),
    "progressive": encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "restarted": encoded(".jpg", cv2.IMWRITE_JPEG_RST_INTERVAL, 2),
    "tiff": encoded(".tiff"),
    "bmp": encoded(".bmp"),
    "pgm": encoded(".pgm"),
    "webp": encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 101),
    "lossy webp": encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 50),
}


@pytest.mark.parametrize("name", list(FILES))
def test_size(name: str) -> None:
    """Width and height are told by every format, as the decoder has them."""
    told = header(FILES[name])
    assert told is not None
    assert told[:2] == ((64, 48), 1)


def test_the_size_of_a_jpeg_is_that_of_its_frame() -> None:
    """Also of one that is coded arithmetically; tables and what is reserved before it hold no size."""
    start, frame = FILES["jpeg"][:2], FILES["jpeg"][2:]
    assert header(start + frame.replace(b"\xff\xc0", b"\xff\xc9", 1)) == Header((64, 48))
    for marker in (0xC4, 0xC8, 0xCC):
        assert header(start + bytes([0xFF, marker, 0, 17]) + bytes(range(15)) + frame) == Header((64, 48))


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_bytes_of_a_pixel(suffix: str, channels: int, kind: type) -> None:
    """How large the pixels become is told before they are decoded."""
    image = np.repeat(IMAGE[..., None], channels, axis=2).astype(kind)
    told = header(bytes(cv2.imencode(suffix, image)[1]))
    assert told is not None
    assert told.pixel_bytes == channels * np.dtype(kind).itemsize


@pytest.mark.parametrize(("kind", "channels"), [(0, 1), (2, 3), (3, 4), (4, 4), (6, 4)])
def test_bytes_of_a_pixel_by_the_type_of_a_png(kind: int, channels: int) -> None:
    """Grey, colour, palette, and the two with transparency, which a decoder fills up to four."""
    start = bytearray(cv2.imencode(".png", IMAGE)[1])
    start[25] = kind
    told = header(bytes(start))
    assert told is not None
    assert told.pixel_bytes == channels


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_orientation(orientation: int, order: str) -> None:
    """How an image is meant to be turned is told, the size is that of what is stored."""
    assert header(with_exif(FILES["jpeg"], orientation, order)) == Header((64, 48), orientation)


def test_orientation_of_png() -> None:
    """In a PNG a chunk tells it, and not what looks like its name among the pixels."""
    tiff = b"MM\0*" + struct.pack(">IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    start, rest = FILES["png"][:33], FILES["png"][33:]
    chunk = struct.pack(">I", len(tiff)) + b"eXIf" + tiff + b"crc "
    assert header(start + chunk + rest) == Header((64, 48), 6, 1)
    text = b"comment: eXIf" + tiff
    assert header(start + struct.pack(">I", len(text)) + b"tEXt" + text + b"crc " + rest) == Header((64, 48), 1, 1)


def test_comments_of_netpbm() -> None:
    """Comments between the numbers of a PGM do not count."""
    assert header(b"P5\n# a camera's\n640 # wide\n480\n255\n") == Header((640, 480))


def test_huge_without_pixels() -> None:
    """A file that only claims to be huge is read by its claim."""
    start = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 30000, 30000) + bytes([8, 0])
    assert header(start) == Header((30000, 30000), 1, 1)


@pytest.mark.parametrize("name", list(FILES))
def test_any_bytes(name: str) -> None:
    """Cut or changed anywhere, a header or nothing comes back, in a moment."""
    rng, good = np.random.default_rng(2), np.frombuffer(FILES[name], np.uint8)
    for cut in (*range(60), len(good) // 2):
        told = header(good[:cut].tobytes())
        assert told is None or isinstance(told, Header)
    for _ in range(300):
        data = good.copy()
        data[rng.integers(0, min(len(data), 200), 4)] = rng.integers(0, 256, 4)
        told = header(data.tobytes())
        assert told is None or min(told.size_px) >= -(2**31)
    assert header(io.BytesIO(b"RIFF\x24\x00\x00\x00AVI LIST").getvalue() + bytes(500)) is None
