"""Tests that images of bags become files without loss."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.errors import InputError
from basecal.exchange.bags.bag import Message, Topic
from basecal.exchange.bags.images import _brightness, _netpbm, image_file

RNG = np.random.default_rng(0)
GREY = RNG.integers(0, 256, (4, 6), dtype=np.uint8)
DEEP = RNG.integers(0, 65536, (4, 6), dtype=np.uint16)
BGR = RNG.integers(0, 256, (4, 6, 3), dtype=np.uint8)


def message(tmp_path: Path, pixels: np.ndarray, encoding: str) -> Message:
    bag = new_bag(tmp_path, "mcap")
    bag.image("/eye/image_raw", BEGIN_S, pixels, encoding)
    topic, kind, time, data = bag.messages[0]
    return Message(Topic(topic, kind, 1), time, data)


@pytest.mark.parametrize(
    ("pixels", "encoding", "expected"),
    [
        (GREY, "mono8", GREY),
        (DEEP, "mono16", DEEP),
        (BGR, "bgr8", BGR),
        (BGR[..., ::-1], "rgb8", BGR),
        (np.dstack([BGR, GREY]), "bgra8", BGR),
        (np.dstack([GREY, GREY // 2]), "yuv422_yuy2", GREY),
        (np.dstack([GREY // 2, GREY]), "uyvy", GREY),
    ],
)
def test_raw_encodings_are_lossless(pixels: np.ndarray, encoding: str, expected: np.ndarray, tmp_path: Path) -> None:
    """Each raw encoding becomes a PGM or PPM file with the same pixels."""
    found = image_file(message(tmp_path, pixels, encoding), "x.bag")
    read = cv2.imdecode(np.frombuffer(found.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert found.ending == (".pgm" if expected.ndim == 2 else ".ppm")
    np.testing.assert_array_equal(read, expected)


def mosaic(bgr: np.ndarray, order: str) -> np.ndarray:
    """Return the colour that a sensor has at each pixel; `order` is that of the first two rows of two."""
    channel = np.array([["bgr".index(c) for c in row] for row in (order[:2], order[2:])])
    rows, columns = np.indices(bgr.shape[:2]) % 2
    return np.take_along_axis(bgr, channel[rows, columns][..., None], axis=2)[..., 0]


@pytest.mark.parametrize("order", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_bayer_images_become_grey(order: str, kind: type, tmp_path: Path) -> None:
    """A uniform colour gives uniform grey up to the borders in any Bayer order; a ramp of grey is not shifted."""
    most = np.iinfo(kind).max
    colour = np.broadcast_to(np.array([0.1, 0.9, 0.4]) * most, (6, 8, 3)).astype(kind)
    ramp = np.broadcast_to(np.arange(8)[:, None] * (most // 8), (6, 8, 3)).astype(kind)
    for bgr in (colour, ramp):
        given = message(tmp_path / str(bgr[0, -1, 0]), mosaic(bgr, order), f"bayer_{order}{8 * kind().itemsize}")
        read = cv2.imdecode(np.frombuffer(image_file(given, "x.bag").content, np.uint8), cv2.IMREAD_UNCHANGED)
        wanted = bgr.astype(float) @ [0.25, 0.5, 0.25]
        assert read.dtype == kind
        np.testing.assert_allclose(read[:, 1:-1], wanted[:, 1:-1], atol=0.5)
        if bgr is colour:
            np.testing.assert_allclose(read, wanted, atol=0.5)


def test_padded_big_endian_rows_are_read(tmp_path: Path) -> None:
    """Rows with `step` longer than their pixels, and 16-bit big-endian values, are read."""
    given = message(tmp_path, np.hstack([DEEP, DEEP[:, :2]]).astype(">u2").view(np.uint16), "mono16")
    given.data.width, given.data.is_bigendian = 6, 1
    read = cv2.imdecode(np.frombuffer(image_file(given, "x.bag").content, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read, DEEP)


def test_compressed_images_are_copied(tmp_path: Path) -> None:
    """JPEG and PNG contents are copied unchanged; other contents are refused."""
    for ending in (".png", ".jpg"):
        content = cv2.imencode(ending, GREY)[1].tobytes()
        bag = new_bag(tmp_path, "ros1")
        bag.compressed("/eye/image_raw/compressed", BEGIN_S, content)
        topic, kind, time, data = bag.messages[0]
        assert image_file(Message(Topic(topic, kind, 1), time, data), "x.bag") == (ending, content)
        data.data = data.data[4:]
        with pytest.raises(InputError, match="expected jpeg or png"):
            image_file(Message(Topic(topic, kind, 1), time, data), "x.bag")


def test_unsupported_images_are_refused(tmp_path: Path) -> None:
    """An unsupported encoding and a truncated image are errors."""
    with pytest.raises(InputError, match="32FC1"):
        image_file(message(tmp_path, GREY, "32FC1"), "x.bag")
    cut = message(tmp_path, GREY, "mono8")
    cut.data.data = cut.data.data[:-1]
    with pytest.raises(InputError, match="23 bytes for 6 x 4 pixels"):
        image_file(cut, "x.bag")


@pytest.mark.parametrize(
    ("pixels", "encoding", "expected"),
    [
        (GREY, "8UC1", GREY),
        (DEEP, "16UC1", DEEP),
        (np.dstack([BGR[..., ::-1], GREY]), "rgba8", BGR),
        (BGR, "8UC3", BGR),
        (np.dstack([BGR, GREY]), "8UC4", BGR),
        (np.dstack([DEEP, DEEP // 2, DEEP // 3]), "bgr16", np.dstack([DEEP, DEEP // 2, DEEP // 3])),
        (np.dstack([DEEP // 3, DEEP // 2, DEEP]), "rgb16", np.dstack([DEEP, DEEP // 2, DEEP // 3])),
        (np.dstack([GREY // 2, GREY]), "yuv422", GREY),
        (np.dstack([GREY, GREY // 2]), "yuyv", GREY),
    ],
)
def test_other_encodings_keep_channels(pixels: np.ndarray, encoding: str, expected: np.ndarray, tmp_path: Path) -> None:
    """Colours keep their order, without opacity; YUV keeps its brightness."""
    found = image_file(message(tmp_path, pixels, encoding), "x.bag")
    read = cv2.imdecode(np.frombuffer(found.content, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read, expected)
    assert read.dtype == expected.dtype


def test_brightness_is_rounded_to_nearest() -> None:
    """Brightness is the rounded binomial mean of each neighbourhood, mirrored at the borders."""
    mosaic_ = RNG.integers(0, 256, (7, 9))
    wide = np.pad(mosaic_, 1, mode="reflect")
    binomial = np.outer([1, 2, 1], [1, 2, 1])
    mean = sum(binomial[i, j] * wide[i : i + 7, j : j + 9] for i in range(3) for j in range(3)) / 16
    np.testing.assert_array_equal(_brightness(mosaic_), np.floor(mean + 0.5))


def test_images_without_pixels_are_damaged(tmp_path: Path) -> None:
    """Zero columns, zero rows, or fewer bytes than pixels are errors."""
    whole = message(tmp_path, GREY, "mono8").data
    for change in ({"width": 0}, {"height": 0}, {"height": 5}, {"step": 5}, {"width": 7}):
        fields = {
            name: getattr(whole, name) for name in ("width", "height", "step", "encoding", "is_bigendian", "data")
        }
        with pytest.raises(InputError, match=r"x: .* is damaged"):
            _netpbm(SimpleNamespace(**{**fields, **change}), "x")
