"""Tests of the image decoder and of its warnings."""

from __future__ import annotations

import os

import cv2
import numpy as np
import pytest

from basecal.vision import decoder
from basecal.vision.decoder import decode
from quick import quick
from vision_scenes import TARGETS, scene

PHOTO = scene(TARGETS["chessboard"])
JPEG = bytes(cv2.imencode(".jpg", PHOTO, [cv2.IMWRITE_JPEG_QUALITY, 90])[1])


def test_intact_image_has_no_damage(capfd: pytest.CaptureFixture[str]) -> None:
    """An intact image has no damage, and nothing is printed."""
    assert decode(JPEG).damage == ""
    assert decode(JPEG[:-2] + bytes(20) + JPEG[-2:]).damage == ""  # padded before its end, as some cameras do
    assert capfd.readouterr() == ("", "")


@pytest.mark.journey
def test_visible_damage_of_jpeg_is_reported(capfd: pytest.CaptureFixture[str]) -> None:
    """Every JPEG with missing or zeroed bytes that differs visibly is reported as damaged, and nothing is printed."""
    rng, sound, silent = np.random.default_rng(0), decode(JPEG).pixels, 0
    assert sound is not None
    for k in range(40):
        at = int(rng.integers(700, len(JPEG) - 3000))
        lost = JPEG[:at] + JPEG[at + int(rng.integers(1, 2000)) :]
        zeroed = JPEG[:at] + bytes(200) + JPEG[at + 200 :]
        pixels, damage = decode((lost, zeroed)[k % 2])
        differs = (
            pixels is None or pixels.shape != sound.shape or (np.abs(pixels.astype(int) - sound) > 30).mean() > 1e-3
        )
        silent += differs and not damage
    assert silent == 0
    assert capfd.readouterr() == ("", "")


def test_short_jpeg_stream_is_damaged() -> None:
    """A single changed bit may shift all following blocks by some pixels.

    The bytes that remain at the end are then damage, not padding.
    """
    data = np.frombuffer(JPEG, np.uint8)

    def comes_out_short(at: int) -> bool:
        changed = data.copy()
        changed[at] ^= 16
        pixels, damage = decode(changed.tobytes())
        return "extraneous bytes before marker 0xd9" in damage and pixels is not None

    assert any(comes_out_short(at) for at in range(2000, len(JPEG) - 100, 397))


def test_damage_message_has_no_library_prefix() -> None:
    """The message of a damage omits the prefix of the library."""
    assert decode(JPEG[:20000] + JPEG[-2:]).damage == "premature end of data segment"


def test_stderr_of_other_threads_is_kept(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """A line that another thread writes to stderr during decoding is neither lost nor attributed to the decoder."""

    def imdecode(*_: object) -> np.ndarray:
        os.write(2, b"a bar at 40 %\nCorrupt JPEG data: bad Huffman code\n")
        return PHOTO

    monkeypatch.setattr(decoder.cv2, "imdecode", imdecode)
    assert decode(JPEG).damage == "bad Huffman code"
    assert capfd.readouterr().err == "a bar at 40 %\n"


def test_decoder_output_is_suppressed(capfd: pytest.CaptureFixture[str]) -> None:
    """Multi-line errors of OpenCV and warnings of libjpeg are not printed, and a warning is no damage."""
    at = JPEG.index(b"JFIF\0") + 5
    assert decode(JPEG[:at] + b"\x10\x4a" + JPEG[at + 2 :]).damage == ""
    assert decode(b"BM" + bytes(40)).pixels is None
    assert decode(b"P5\n24 18\n255\n").pixels is None
    assert capfd.readouterr() == ("", "")


@pytest.mark.journey
@pytest.mark.parametrize("quality", quick([30, 80, 95], [80]))
def test_damaged_webp_is_reported(quality: int) -> None:
    """Nineteen of twenty lossy WebPs with one changed byte are reported. Intact ones, even or noisy, are not."""
    rng, silent = np.random.default_rng(1), 0
    images = [PHOTO, np.full_like(PHOTO, 90), rng.integers(0, 256, (90, 70, 3)).astype(np.uint8)]
    for image in [*images, np.where(np.indices((64, 64)).sum(0) < 30, 20, 230).astype(np.uint8)]:
        data = bytes(cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, quality])[1])
        assert decode(data).damage == ""
    sound = bytes(cv2.imencode(".webp", PHOTO, [cv2.IMWRITE_WEBP_QUALITY, quality])[1])
    undamaged = decode(sound).pixels
    for at in rng.integers(40, len(sound), 40):
        damaged = sound[:at] + bytes([sound[at] ^ 0x55]) + sound[at + 1 :]
        pixels, damage = decode(damaged)
        silent += pixels is not None and not damage and not np.array_equal(pixels, undamaged)
    assert silent <= 2
