"""Headers of image files: format, size and orientation, without decoding of pixels."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # not of tables, reserved or arithmetic coding
_BARE_MARKERS = frozenset({0x01, *range(0xD0, 0xD8)})  # JPEG markers without a length
_MOST_SEGMENTS = 10_000  # of a JPEG: cameras write ten
_MOST_CHUNKS = 2**17  # of a PNG: four times those of the largest file, 256 MB in chunks of 8 kB
_MOST_TAGS = 500  # of one directory of a TIFF: cameras write fifty
_WIDTH, _HEIGHT, _BITS, _ORIENTATION, _SAMPLES = 256, 257, 258, 274, 277  # tags of a TIFF
_TIFF_STARTS = (b"II*\0", b"MM\0*")
_WHOLE_NUMBER_TYPES = {3: "H", 4: "I"}  # integer types of a TIFF
_PNG_CHANNELS = {0: 1, 2: 3, 3: 4, 4: 4, 6: 4}  # decoded channels for each colour type
_NETPBM = re.compile(rb"P[2356]\s(?:\s*#[^\n]*\n)*\s*(\d{1,9})\s(?:\s*#[^\n]*\n)*\s*(\d{1,9})\s")


class Header(NamedTuple):
    """The header of an image file.

    Attributes:
        size_px: Width and height.
        pixel_bytes: Largest number of bytes of a decoded pixel.
        orientation: EXIF orientation for display, 1 to 8; 1 for none.
    """

    size_px: tuple[int, int]
    orientation: int = 1
    pixel_bytes: int = 4


def read_header(data: bytes) -> Header | None:
    """Read the header of an image; None if the format is not supported or the header is broken.

    Source: PNG 3rd edition; ITU-T T.81; TIFF 6.0; EXIF 2.32; RFC 9649; netpbm's pages.
    """
    for start, read in _HEADER_READERS.items():
        if data.startswith(start):
            try:
                return read(data)
            except (struct.error, LookupError, ValueError):
                return None
    return None


def _png(data: bytes) -> Header:
    width, height, bits, kind = struct.unpack_from(">IIBB", data, 16)
    exif = next((data[start:end] for name, start, end in png_chunks(data) if name == b"eXIf"), None)
    orientation = 1 if exif is None else _exif_orientation(exif)
    return Header((width, height), orientation, _PNG_CHANNELS.get(kind, 4) * (1 + (bits > 8)))


def png_chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Complete chunks of a PNG: name, start and end of the content of each."""
    position = 8
    for _ in range(_MOST_CHUNKS):
        if position + 12 > len(data):
            break
        length, name = struct.unpack_from(">I4s", data, position)
        if position + 12 + length > len(data):
            break
        yield name, position + 8, position + 8 + length
        position += 12 + length


def _bmp(data: bytes) -> Header:
    if struct.unpack_from("<I", data, 14)[0] == 12:  # the oldest header
        return Header(struct.unpack_from("<HH", data, 18))
    width, height = struct.unpack_from("<ii", data, 18)
    return Header((width, abs(height)))


def _jpeg(data: bytes) -> Header:
    orientation = 1
    for marker, position in _segments(data):
        if marker == 0xE1 and data[position + 2 : position + 8] == b"Exif\0\0":
            orientation = _exif_orientation(data[position + 8 : position + struct.unpack_from(">H", data, position)[0]])
        if marker in _FRAME_MARKERS:
            height, width = struct.unpack_from(">HH", data, position + 3)
            return Header((width, height), orientation)
    raise ValueError("no frame")


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Markers of a JPEG, each with the position of its length field."""
    position = 2
    for _ in range(_MOST_SEGMENTS):
        position = data.index(b"\xff", position) if b"\xff" in data[position : position + 2**16] else len(data)
        while data[position] == 0xFF:
            position += 1
        marker = data[position]
        position += 1
        if marker not in _BARE_MARKERS:
            yield marker, position
            position += max(struct.unpack_from(">H", data, position)[0], 2)


def _tiff(data: bytes) -> Header:
    tags = _tiff_tags(data)
    size_px = (tags[_WIDTH], tags[_HEIGHT])
    return Header(size_px, tags.get(_ORIENTATION, 1), tags.get(_SAMPLES, 1) * -(-tags.get(_BITS, 1) // 8))


def with_stored_order(data: bytes) -> bytes:
    """Return a TIFF with orientation 1, since OpenCV applies it; other data, and a broken TIFF, are returned as is."""
    if not data.startswith(_TIFF_STARTS):
        return data
    changed = bytearray(data)
    try:
        for tag, position, kind in _tiff_entries(data):
            if tag == _ORIENTATION:
                struct.pack_into(kind, changed, position, 1)
    except struct.error:
        return data
    return bytes(changed)


def _exif_orientation(exif: bytes) -> int:
    """Orientation in EXIF data; 1 without one, and if the data are broken, which does not affect the pixels."""
    try:
        return _tiff_tags(exif).get(_ORIENTATION, 1)
    except struct.error:
        return 1


def _tiff_tags(data: bytes) -> dict[int, int]:
    """Integer values of the first directory of a TIFF, by tag; the first value of a list."""
    return {tag: struct.unpack_from(kind, data, position)[0] for tag, position, kind in _tiff_entries(data)}


def _tiff_entries(data: bytes) -> Iterator[tuple[int, int, str]]:
    """Integer entries of the first directory of a TIFF: tag, position of the first value, and its format."""
    order = "<" if data[:2] == b"II" else ">"
    (directory,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, directory)
    for k in range(min(count, _MOST_TAGS)):
        tag, kind, values = struct.unpack_from(order + "HHI", data, directory + 2 + 12 * k)
        if kind in _WHOLE_NUMBER_TYPES:
            is_inline = values * struct.calcsize(_WHOLE_NUMBER_TYPES[kind]) <= 4
            position = directory + 10 + 12 * k
            if not is_inline:
                position = struct.unpack_from(order + "I", data, position)[0]
            yield tag, position, order + _WHOLE_NUMBER_TYPES[kind]


def _webp(data: bytes) -> Header:
    if data[8:12] != b"WEBP":
        raise ValueError("another kind of RIFF")
    kind = data[12:16]
    if kind == b"VP8X":
        width, height = (int.from_bytes(data[start : start + 3], "little") + 1 for start in (24, 27))
    elif kind == b"VP8L":
        bits = struct.unpack_from("<I", data, 21)[0]
        width, height = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    else:
        width, height = (side & 0x3FFF for side in struct.unpack_from("<HH", data, 26))
    return Header((width, height))


def _netpbm(data: bytes) -> Header:
    match = _NETPBM.match(data[:4096])
    if match is None:
        raise ValueError("no size")
    return Header((int(match[1]), int(match[2])))


_HEADER_READERS: dict[bytes, Callable[[bytes], Header]] = {
    b"\x89PNG\r\n\x1a\n": _png,
    b"\xff\xd8\xff": _jpeg,
    **dict.fromkeys(_TIFF_STARTS, _tiff),
    b"BM": _bmp,
    b"RIFF": _webp,
    **dict.fromkeys((b"P2", b"P3", b"P5", b"P6"), _netpbm),
}
"""Header readers by the first bytes of a file."""

SIGNATURES = tuple(_HEADER_READERS)
"""First bytes of the supported image formats."""
