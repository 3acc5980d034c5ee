"""Tests of reading and writing image files, intact or damaged."""

from __future__ import annotations

import os
import struct
import time
import tracemalloc
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.vision import image_file
from basecal.vision.image_file import grey_image, is_turned, read_bytes, write_png
from vision_scenes import TARGETS, scene, with_exif

SIZE = (64, 48)
IMAGE = np.random.default_rng(0).integers(0, 256, SIZE[::-1]).astype(np.uint8)


def encoded(suffix: str, picture: np.ndarray = IMAGE) -> bytes:
    return bytes(cv2.imencode(suffix, picture)[1])


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".pgm", ".webp"])
def test_lossless_grey_image_is_exact(suffix: str) -> None:
    """A losslessly stored image is read exactly."""
    picture = np.repeat(IMAGE[..., None], 3, axis=2) if suffix == ".webp" else IMAGE
    image = grey_image(encoded(suffix, picture), SIZE)
    assert not isinstance(image, str)
    np.testing.assert_array_equal(image, IMAGE)


def test_sixteen_bits_are_kept() -> None:
    """An image of 16 bits keeps all of them."""
    deep = IMAGE.astype(np.uint16) * 251
    image = grey_image(encoded(".png", deep), SIZE)
    assert not isinstance(image, str)
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, deep)


@pytest.mark.parametrize("channels", [3, 4])
def test_equal_colours_become_grey(channels: int) -> None:
    """Three equal colour channels, with or without transparency, give their common value."""
    image = grey_image(encoded(".png", np.repeat(IMAGE[..., None], channels, axis=2)), SIZE)
    assert not isinstance(image, str)
    np.testing.assert_array_equal(image, IMAGE)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_truncated_file_is_refused(suffix: str, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    """A file truncated anywhere is reported as incomplete, and the decoder prints nothing."""
    data = encoded(suffix)
    why = grey_image(data[: int(share * len(data))], SIZE)
    assert isinstance(why, str)
    assert "truncated" in why or "not an image" in why
    assert capfd.readouterr() == ("", "")


def test_padding_is_allowed() -> None:
    """Bytes after the end of an image, as some cameras write them, have no effect."""
    for suffix in (".png", ".jpg", ".bmp"):
        assert not isinstance(grey_image(encoded(suffix) + bytes(100), SIZE), str)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "empty"),
        (b"hello", "not an image"),
        (b"\x00\x00\x00\x18ftypmp42" + bytes(500), "not an image"),
        (b"RIFF\x24\x00\x00\x00AVI LIST" + bytes(500), "not an image"),
        (encoded(".png", IMAGE[:, :60]), "has 60 x 48 pixels, its camera 64 x 48"),
        (encoded(".tiff", IMAGE.astype(np.float32)), "float32"),
    ],
    ids=["empty", "text", "mp4", "avi", "size", "float"],
)
def test_unusable_image_has_a_reason(data: bytes, reason: str) -> None:
    """The reason why an image is unusable is given in words."""
    why = grey_image(data, SIZE)
    assert isinstance(why, str)
    assert reason in why


@pytest.mark.filterwarnings("default")
def test_random_changes_do_not_raise() -> None:
    """A file with random changes gives an image or a reason, never an exception."""
    rng = np.random.default_rng(1)
    for suffix in (".png", ".jpg", ".bmp", ".tiff", ".webp", ".pgm"):
        good = np.frombuffer(encoded(suffix), np.uint8)
        for _ in range(20):
            data = good.copy()
            data[rng.integers(0, len(data), 5)] = rng.integers(0, 256, 5)
            result = grey_image(data.tobytes(), SIZE)
            assert isinstance(result, str) or result.shape == SIZE[::-1]


def test_missing_file_and_folder_have_reasons(tmp_path: Path) -> None:
    """A path that is missing or not a file gives a reason in words."""
    assert read_bytes(tmp_path / "none.png") == "is missing, its folder is empty"
    assert read_bytes(tmp_path / "no" / "none.png") == "is missing, as is its folder"
    assert read_bytes(tmp_path) == "cannot be read: Is a directory"
    (tmp_path / "some").write_bytes(b"abc")
    assert read_bytes(tmp_path / "some") == b"abc"
    assert read_bytes(tmp_path / "none.png") == "is missing"
    (tmp_path / "none.jpg").write_bytes(b"abc")
    assert read_bytes(tmp_path / "none.png") == "is missing (did you mean .jpg?)"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_pipe_and_device_are_refused(tmp_path: Path) -> None:
    """A pipe without a writer and an endless device are refused immediately."""
    os.mkfifo(tmp_path / "pipe")
    assert str(read_bytes(tmp_path / "pipe")).startswith("is not a file but a pipe")
    assert str(read_bytes(Path("/dev/zero"))).startswith("is not a file but a pipe")


def test_too_large_file_is_refused(tmp_path: Path) -> None:
    """A file larger than any image is refused by its size."""
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2**31)
    assert str(read_bytes(tmp_path / "large")).startswith("has more than 256 MB")


def test_size_limit_of_files_is_inclusive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of exactly the size limit is read completely, and one that is a byte larger is refused."""
    monkeypatch.setattr(image_file, "_LARGEST_BYTES", 2**20)
    (tmp_path / "largest").write_bytes(bytes(2**20))
    assert read_bytes(tmp_path / "largest") == bytes(2**20)
    (tmp_path / "larger").write_bytes(bytes(2**20 + 1))
    assert read_bytes(tmp_path / "larger") == "has more than 1 MB, the limit of such files; is it the right one?"


def test_reserved_bytes_of_bmp_are_ignored() -> None:
    """The four reserved bytes after a BMP's length are ignored. Only the length determines whether it is truncated."""
    image = np.arange(48, dtype=np.uint8).reshape(6, 8)
    data = bytearray(cv2.imencode(".bmp", image)[1].tobytes())
    data[6:10] = b"\x07\x08\x09\x0a"
    np.testing.assert_array_equal(grey_image(bytes(data), None), image)
    assert grey_image(bytes(data[:-1]), None) == "is truncated"


def test_impossible_file_names_have_reasons(tmp_path: Path) -> None:
    """A name that no file can have gives a reason in words."""
    for name in ("a\0b.png", "\ud800.png"):
        assert "cannot be read" in str(read_bytes(tmp_path / name)) or read_bytes(tmp_path / name) == "is missing"


def huge(width: int, height: int) -> bytes:
    """PNG of a few megabytes that decodes to gigabytes."""
    rows = zlib.compressobj(9)
    body = b"".join(rows.compress(bytes(1 + width)) for _ in range(height)) + rows.flush()
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)), (b"IDAT", body), (b"IEND", b""))
    written = (struct.pack(">I", len(of)) + name + of + struct.pack(">I", zlib.crc32(name + of)) for name, of in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(written)


@pytest.mark.journey
def test_huge_image_is_refused_by_its_header() -> None:
    """An image of 90 megapixels is refused by its header, within a second and a megabyte of memory."""
    data = huge(30000, 3000)
    tracemalloc.start()
    began = time.perf_counter()
    why = grey_image(data, None)
    assert time.perf_counter() - began < 1
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    assert why == "has 30000 x 3000 pixels, expected 1 to 64 million"


def test_jpeg_with_too_many_scans_is_refused() -> None:
    """A JPEG with more than 100 scans is refused.

    One of a megabyte whose ten thousand scans pass over 64 megapixels each took six minutes.
    """
    data = cv2.imencode(".jpg", np.zeros((18, 24), np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    start, end = data.rfind(b"\xff\xc4"), data.rfind(b"\xff\xd9")
    assert isinstance(grey_image(data, None), np.ndarray)
    many = data[:end] + data[start:end] * 95 + data[end:]
    assert grey_image(many, None) == "has 101 scans, expected at most 100: store it again"


def test_too_many_bytes_of_pixels_are_refused() -> None:
    """An image with more than 256 MB of pixels is refused.

    Decoders hold an image twice: 60 megapixels of four channels and 16 bits would be a gigabyte.
    """
    start = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sIIBB", 13, b"IHDR", 8000, 7500, 16, 6)
    assert grey_image(start, None) == "has 457 MB of pixels, expected at most 256: store it grey, or with 8 bits"


BOARD = scene(TARGETS["chessboard"])


def test_half_missing_jpeg_is_refused() -> None:
    """A JPEG with missing data, which decoders fill with grey, is refused: its corners were hundreds of pixels off."""
    data = encoded(".jpg", BOARD)
    why = grey_image(data[: len(data) // 2] + data[-2:], None)
    assert why == "is damaged (premature end of data segment)"
    assert isinstance(cv2.imdecode(np.frombuffer(data[: len(data) // 2] + data[-2:], np.uint8), 0), np.ndarray)


def test_png_chunk_longer_than_file_is_refused() -> None:
    """A PNG chunk with a stated length of two gigabytes is refused before a decoder allocates memory for it."""
    data = encoded(".png")
    at = data.index(b"IDAT") - 4
    tracemalloc.start()
    why = grey_image(data[:at] + b"\x7f\xff\xff\xf0" + data[at + 4 :], SIZE)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    assert why == "is truncated"


def test_truncated_webp_is_refused() -> None:
    """A WebP that is shorter than its stated length is truncated."""
    data = encoded(".webp", np.repeat(IMAGE[..., None], 3, axis=2))
    assert grey_image(data[:-20], SIZE) == "is truncated"


def test_damaged_png_is_refused() -> None:
    """A PNG with one changed byte is refused as damaged."""
    data = bytearray(encoded(".png", BOARD))
    data[len(data) // 2] ^= 1
    assert str(grey_image(bytes(data), None)).startswith("is damaged")


@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_exif_orientation_is_not_applied(orientation: int) -> None:
    """The EXIF orientation does not rotate the pixels, since the lens model refers to the sensor. It is reported."""
    data = with_exif(encoded(".jpg"), orientation)
    image = grey_image(data, SIZE)
    assert not isinstance(image, str)
    np.testing.assert_array_equal(image, grey_image(encoded(".jpg"), SIZE))
    assert is_turned(data) == (orientation != 1)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_tiff_orientation_is_not_applied(orientation: int, kind: type) -> None:
    """OpenCV rotates and mirrors a TIFF by its orientation; its pixels are returned as they are stored."""
    stored = np.random.default_rng(0).integers(0, 255, (48, 64)).astype(kind)
    size = stored.itemsize
    tags = [(256, 64), (257, 48), (258, 8 * size), (259, 1), (262, 1), (273, 200), (274, orientation), (277, 1)]
    tags += [(278, 48), (279, stored.nbytes)]
    entries = b"".join(struct.pack("<HHII", tag, 4 if tag in (273, 279) else 3, 1, value) for tag, value in tags)
    start = b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries
    data = start.ljust(200, b"\0") + stored.tobytes()
    np.testing.assert_array_equal(grey_image(data, SIZE), stored)
    assert is_turned(data) == (orientation != 1)


@pytest.mark.parametrize("exif", [b"", b"II*\0\xff\xff\xff\xff", b"no directory"])
def test_damaged_exif_does_not_damage_image(exif: bytes) -> None:
    """The pixels of an image with damaged EXIF are intact, and its orientation is unknown."""
    jpeg = encoded(".jpg")
    data = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 8) + b"Exif\0\0" + exif + jpeg[2:]
    np.testing.assert_array_equal(grey_image(data, SIZE), grey_image(jpeg, SIZE))
    assert not is_turned(data)


TO_DO = "use these images, or state size_px and the lens of the recorded images"


@pytest.mark.parametrize(
    ("size_px", "cause"),
    [
        ((48, 64), ": width and height look swapped between image and lens; pixels count as the sensor gave them"),
        (
            (128, 96),
            f": the lens seems to be of images scaled by 2; {TO_DO}",
        ),
        (
            (32, 24),
            f": the lens seems to be of images scaled by 0.5; {TO_DO}",
        ),
        ((60, 48), ""),
    ],
)
def test_size_mismatch_has_a_cause(size_px: tuple[int, int], cause: str) -> None:
    """The message states if the size of the camera is that of the image swapped or scaled."""
    assert grey_image(encoded(".png"), size_px) == f"has 64 x 48 pixels, its camera {size_px[0]} x {size_px[1]}{cause}"


def test_images_are_written_and_overwritten(tmp_path: Path) -> None:
    """Images of both depths are written into new folders and over existing files.

    A file in place of the folder is an error of one line.
    """
    for image in (IMAGE, IMAGE.astype(np.uint16) * 251, IMAGE):
        write_png(tmp_path / "a" / "b" / "c.png", image)
        np.testing.assert_array_equal(grey_image((tmp_path / "a/b/c.png").read_bytes(), SIZE), image)
    with pytest.raises(InputError, match=r"c\.png.d\.png cannot be written"):
        write_png(tmp_path / "a" / "b" / "c.png" / "d.png", IMAGE)
