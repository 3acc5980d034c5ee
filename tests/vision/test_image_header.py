"""Tests of the headers of image files."""

from __future__ import annotations

import io
import struct

import cv2
import numpy as np
import pytest

from basecal.vision.image_header import Header, png_chunks, read_header
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
def test_header_has_image_size(name: str) -> None:
    """The header of every format gives the width and height that the decoder returns."""
    header = read_header(FILES[name])
    assert header is not None
    assert header[:2] == ((64, 48), 1)


def test_jpeg_size_is_that_of_its_frame() -> None:
    """The size is in the frame, also with arithmetic coding. Tables and reserved segments before it have no size."""
    start, frame = FILES["jpeg"][:2], FILES["jpeg"][2:]
    assert read_header(start + frame.replace(b"\xff\xc0", b"\xff\xc9", 1)) == Header((64, 48))
    for marker in (0xC4, 0xC8, 0xCC):
        assert read_header(start + bytes([0xFF, marker, 0, 17]) + bytes(range(15)) + frame) == Header((64, 48))


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_header_has_bytes_per_pixel(suffix: str, channels: int, kind: type) -> None:
    """The header gives the number of bytes per pixel before decoding."""
    image = np.repeat(IMAGE[..., None], channels, axis=2).astype(kind)
    header = read_header(bytes(cv2.imencode(suffix, image)[1]))
    assert header is not None
    assert header.pixel_bytes == channels * np.dtype(kind).itemsize


@pytest.mark.parametrize(("kind", "channels"), [(0, 1), (2, 3), (3, 4), (4, 4), (6, 4)])
def test_png_type_determines_bytes_per_pixel(kind: int, channels: int) -> None:
    """The types are grey, colour, palette, and the two with transparency, which a decoder extends to four channels."""
    start = bytearray(cv2.imencode(".png", IMAGE)[1])
    start[25] = kind
    header = read_header(bytes(start))
    assert header is not None
    assert header.pixel_bytes == channels


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_header_has_exif_orientation(orientation: int, order: str) -> None:
    """The header gives the orientation of an image, and the size of the stored pixels."""
    assert read_header(with_exif(FILES["jpeg"], orientation, order)) == Header((64, 48), orientation)


def test_png_orientation_is_read_from_its_chunk() -> None:
    """The orientation of a PNG is in the chunk eXIf, not in other data that resembles its name."""
    tiff = b"MM\0*" + struct.pack(">IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    start, rest = FILES["png"][:33], FILES["png"][33:]
    chunk = struct.pack(">I", len(tiff)) + b"eXIf" + tiff + b"crc "
    assert read_header(start + chunk + rest) == Header((64, 48), 6, 1)
    text = b"comment: eXIf" + tiff
    assert read_header(start + struct.pack(">I", len(text)) + b"tEXt" + text + b"crc " + rest) == Header((64, 48), 1, 1)


def test_netpbm_comments_are_skipped() -> None:
    """Comments between the numbers of a PGM are skipped."""
    assert read_header(b"P5\n# a camera's\n640 # wide\n480\n255\n") == Header((640, 480))


def test_header_of_huge_image_is_read() -> None:
    """The header of a file that only states a huge size is read as stated."""
    start = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 30000, 30000) + bytes([8, 0])
    assert read_header(start) == Header((30000, 30000), 1, 1)


@pytest.mark.parametrize("name", list(FILES))
def test_damaged_header_does_not_raise(name: str) -> None:
    """A file that is truncated or changed anywhere gives a header or None, quickly."""
    rng, good = np.random.default_rng(2), np.frombuffer(FILES[name], np.uint8)
    for cut in (*range(60), len(good) // 2):
        header = read_header(good[:cut].tobytes())
        assert header is None or isinstance(header, Header)
    for _ in range(300):
        data = good.copy()
        data[rng.integers(0, min(len(data), 200), 4)] = rng.integers(0, 256, 4)
        header = read_header(data.tobytes())
        assert header is None or min(header.size_px) >= -(2**31)
    assert read_header(io.BytesIO(b"RIFF\x24\x00\x00\x00AVI LIST").getvalue() + bytes(500)) is None


def tiff(*tags: tuple[int, int, int, int], order: str = "<", values: bytes = b"") -> bytes:
    """TIFF with tags of number, type, count and value or offset; `values` follow at byte 100."""
    start = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "IH", 8, len(tags))
    fields = [
        struct.pack(order + ("HHIHH" if tag[1] == 3 and tag[2] == 1 else "HHII"), *tag, *[0] * (tag[1:3] == (3, 1)))
        for tag in tags
    ]
    return (start + b"".join(fields)).ljust(100, b"\0") + values


@pytest.mark.parametrize("order", ["<", ">"])
def test_tiff_tags_are_read(order: str) -> None:
    """Tags have long or short numbers.

    The first of a list is read, which is elsewhere unless the list fits into four bytes.
    """
    size = ((256, 4, 1, 70000), (257, 3, 1, 480))
    assert read_header(tiff(*size, order=order)) == Header((70000, 480), 1, 1)
    listed = struct.pack(order + "HHH", 9, 8, 8)
    assert read_header(tiff(*size, (258, 3, 3, 100), (277, 3, 1, 3), order=order, values=listed)) == Header(
        (70000, 480), 1, 6
    )
    pair = int.from_bytes(struct.pack(order + "HH", 16, 8), "little" if order == "<" else "big")
    assert read_header(tiff(*size, (258, 3, 2, pair), order=order)) == Header((70000, 480), 1, 2)
    assert read_header(tiff((256, 4, 2, 100), size[1], order=order, values=struct.pack(order + "II", 5, 6)))[0] == (
        5,
        480,
    )


def test_unsupported_tiff_types_are_skipped() -> None:
    """A rational orientation is ignored; there is no header without a size."""
    size = ((256, 4, 1, 640), (257, 4, 1, 480))
    assert read_header(tiff(*size, (274, 5, 1, 6))) == Header((640, 480), 1, 1)
    assert read_header(tiff(*size, (274, 3, 1, 6))) == Header((640, 480), 6, 1)
    assert read_header(tiff(size[0])) is None


@pytest.mark.parametrize(("before", "read"), [(498, True), (499, False)])
def test_tiff_directory_is_limited_to_500_tags(before: int, read: bool) -> None:
    """Only the first five hundred tags of a longer directory are read."""
    others = [(1000 + k, 3, 1, 0) for k in range(before)]
    assert (read_header(tiff(*others, (256, 4, 1, 640), (257, 4, 1, 480))) is not None) == read


def test_bmp_sizes_are_read() -> None:
    """The oldest header has two bytes per side; a negative height means that rows start at the top."""
    old = b"BM".ljust(14, b"\0") + struct.pack("<IHH", 12, 640, 480)
    assert read_header(old) == Header((640, 480))
    assert read_header(b"BM".ljust(14, b"\0") + struct.pack("<Iii", 40, 70000, -480)) == Header((70000, 480))


def test_webp_sizes_are_read() -> None:
    """The sizes in all three WebP headers are read.

    The extended header has three bytes per side, the lossless one 14 bits, the lossy one 14 of 16 bits with a scale.
    """
    start = b"RIFF\0\0\0\0WEBP"
    extended = start + b"VP8X" + bytes(8) + (69999).to_bytes(3, "little") + (479).to_bytes(3, "little")
    assert read_header(extended) == Header((70000, 480))
    lossless = start + b"VP8L" + bytes(5) + struct.pack("<I", 9999 | 8999 << 14 | 3 << 28)
    assert read_header(lossless) == Header((10000, 9000))
    lossy = start + b"VP8 " + bytes(10) + struct.pack("<HH", 10000 | 1 << 14, 9000 | 2 << 14)
    assert read_header(lossy) == Header((10000, 9000))


def png(*chunks: tuple[bytes, bytes], bits: int = 8, kind: int = 0) -> bytes:
    """PNG of 640 x 480 without pixels and with given chunks."""
    size = struct.pack(">IIBB", 640, 480, bits, kind) + bytes(3)
    every = ((b"IHDR", size), *chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I4s", len(d), n) + d + b"crc " for n, d in every)


def test_incomplete_png_chunk_is_skipped() -> None:
    """A chunk is complete with the last byte of its checksum, and is given by its content."""
    data = png((b"tEXt", b"hello"), (b"IEND", b""))
    found = [(name, data[start:end]) for name, start, end in png_chunks(data)]
    assert [name for name, _ in found] == [b"IHDR", b"tEXt", b"IEND"]
    assert found[1:] == [(b"tEXt", b"hello"), (b"IEND", b"")]
    assert [name for name, *_ in png_chunks(data[:-1])] == [b"IHDR", b"tEXt"]
    assert [name for name, *_ in png_chunks(data[:-13])] == [b"IHDR"]


@pytest.mark.parametrize(("bits", "size"), [(1, 1), (8, 1), (16, 2)])
def test_png_bit_depth_determines_bytes(bits: int, size: int) -> None:
    """Up to eight bits are a byte; an unknown type is treated as the largest."""
    assert read_header(png(bits=bits)) == Header((640, 480), 1, size)
    assert read_header(png(bits=bits, kind=7)) == Header((640, 480), 1, 4 * size)


def test_jpeg_segments_are_skipped() -> None:
    """Bytes between segments, fill bytes and markers without a length are skipped."""
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 8, 8, 480, 640, 1)
    for between in (b"", b"\xff\xff", b"\xff\x01", b"\xff\xd0\xff\xd7", b"\0\1\2", b"\xff\xe1\0\2", b"\xff\xe0\0\0"):
        assert read_header(b"\xff\xd8" + b"\xff\xe0\0\4ab" + between + frame) == Header((640, 480))
    assert read_header(b"\xff\xd8" + b"\xff\xe0\0\4ab") is None


def test_orientation_is_only_read_from_exif() -> None:
    """Another segment with the same marker has no orientation, nor has one that is truncated before its tags."""
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 8, 8, 480, 640, 1)
    exif = tiff((274, 3, 1, 6))
    for name, marker, orientation in ((b"Exif\0\0", 0xE1, 6), (b"XMPx\0\0", 0xE1, 1), (b"Exif\0\0", 0xE2, 1)):
        segment = bytes([0xFF, marker]) + struct.pack(">H", 8 + len(exif)) + name + exif
        assert read_header(b"\xff\xd8" + segment + frame) == Header((640, 480), orientation)
    cut = b"\xff\xe1" + struct.pack(">H", 8 + 12) + b"Exif\0\0" + exif
    assert read_header(b"\xff\xd8" + cut + frame) == Header((640, 480))


def test_exif_without_orientation_is_upright() -> None:
    """EXIF without an orientation means upright, in a JPEG and in a PNG."""
    frame = b"\xff\xc0" + struct.pack(">HBHHB", 8, 8, 480, 640, 1)
    exif = tiff((256, 3, 1, 6))
    segment = b"\xff\xe1" + struct.pack(">H", 8 + len(exif)) + b"Exif\0\0" + exif
    assert read_header(b"\xff\xd8" + segment + frame) == Header((640, 480), 1)
    found = read_header(png((b"eXIf", exif)))
    assert found is not None
    assert found.orientation == 1
