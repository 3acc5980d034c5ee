"""Images from files, whatever the files hold."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.vision.image_file import grey_image, read_bytes

SIZE = (64, 48)
PICTURE = np.random.default_rng(0).integers(0, 256, SIZE[::-1]).astype(np.uint8)


def encoded(suffix: str, picture: np.ndarray = PICTURE) -> bytes:
    return bytes(cv2.imencode(suffix, picture)[1])


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".pgm", ".webp"])
def test_grey_is_kept(suffix: str) -> None:
    """An image stored without loss is given as it is."""
    picture = np.repeat(PICTURE[..., None], 3, axis=2) if suffix == ".webp" else PICTURE
    image = grey_image(encoded(suffix, picture), SIZE)
    assert not isinstance(image, str)
    np.testing.assert_array_equal(image, PICTURE)


def test_sixteen_bits_are_kept() -> None:
    """An image of 16 bits keeps all of them."""
    deep = PICTURE.astype(np.uint16) * 251
    image = grey_image(encoded(".png", deep), SIZE)
    assert not isinstance(image, str)
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, deep)


@pytest.mark.parametrize("channels", [3, 4])
def test_colour_becomes_grey(channels: int) -> None:
    """Of three equal colours, with or without transparency, grey is their common value."""
    image = grey_image(encoded(".png", np.repeat(PICTURE[..., None], channels, axis=2)), SIZE)
    assert not isinstance(image, str)
    np.testing.assert_array_equal(image, PICTURE)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_cut_files(suffix: str, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    """A file cut anywhere is said to be no whole image, and the decoder prints nothing."""
    data = encoded(suffix)
    why = grey_image(data[: int(share * len(data))], SIZE)
    assert isinstance(why, str)
    assert "truncated" in why or "not an image" in why
    assert capfd.readouterr() == ("", "")


def test_padding_is_allowed() -> None:
    """Bytes after the end of an image, as some cameras write them, do no harm."""
    for suffix in (".png", ".jpg", ".bmp"):
        assert not isinstance(grey_image(encoded(suffix) + bytes(100), SIZE), str)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "empty"),
        (b"hello", "not an image"),
        (b"\x00\x00\x00\x18ftypmp42" + bytes(500), "not an image"),
        (b"RIFF\x24\x00\x00\x00AVI LIST" + bytes(500), "not an image"),
        (encoded(".png", PICTURE[:, :60]), "has 60 x 48 pixels, its camera 64 x 48"),
        (encoded(".tiff", PICTURE.astype(np.float32)), "float32"),
    ],
    ids=["empty", "text", "mp4", "avi", "size", "float"],
)
def test_why_not(data: bytes, reason: str) -> None:
    """What is no usable image is told in words."""
    why = grey_image(data, SIZE)
    assert isinstance(why, str)
    assert reason in why


@pytest.mark.filterwarnings("default")
def test_random_bytes_never_fail() -> None:
    """Whatever is changed in a file, an image or a sentence comes back."""
    rng = np.random.default_rng(1)
    for suffix in (".png", ".jpg", ".bmp", ".tiff", ".webp", ".pgm"):
        good = np.frombuffer(encoded(suffix), np.uint8)
        for _ in range(20):
            data = good.copy()
            data[rng.integers(0, len(data), 5)] = rng.integers(0, 256, 5)
            result = grey_image(data.tobytes(), SIZE)
            assert isinstance(result, str) or result.shape == SIZE[::-1]


def test_missing_and_folder(tmp_path: Path) -> None:
    """A path that is not there or not a file is told in words."""
    assert read_bytes(tmp_path / "none.png") == "is missing"
    assert read_bytes(tmp_path) == "is not a file"
    (tmp_path / "some").write_bytes(b"abc")
    assert read_bytes(tmp_path / "some") == b"abc"
