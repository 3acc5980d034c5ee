"""Tests of the cache of detections."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from basecal.vision import cache
from basecal.vision.detection import Detection
from vision_scenes import TARGETS

FOUND = Detection(np.array([1, 4]), np.array([[1.5, 2.25], [300.125, 4.0]]), np.array([0.1, 0.02]))
LIGHTS = Detection(None, np.array([[1.5, 2.25]]), np.array([0.1]))


@pytest.mark.parametrize("detection", [FOUND, LIGHTS, None], ids=["corners", "candidates", "nothing"])
def test_cached_detection_is_read_exactly(detection: Detection | None, tmp_path: Path) -> None:
    """A cached detection is read to the last bit, and a cached failure to detect as well."""
    assert cache.read(tmp_path, "a") is None
    cache.write(tmp_path, "a", detection)
    kept = cache.read(tmp_path, "a")
    assert kept is not None
    (again,) = kept
    if detection is None:
        assert again is None
        return
    assert again is not None
    np.testing.assert_array_equal(again.pixels, detection.pixels)
    np.testing.assert_array_equal(again.sigma_px, detection.sigma_px)
    assert (again.ids is None) == (detection.ids is None)
    assert detection.ids is None or np.array_equal(again.ids, detection.ids)


@pytest.mark.parametrize("kind", ["pipe", "device", "link"])
def test_pipes_and_links_in_cache_are_ignored(tmp_path: Path, kind: str) -> None:
    """The cache reads neither a pipe, which would block, nor the target of a link outside of the cell."""
    cache.write(tmp_path / "outside", "a", FOUND)
    cache.write(tmp_path / "cell", "b", FOUND)
    path = tmp_path / "cell" / "derived" / "detections" / "a.json"
    source = tmp_path / "outside" / "derived" / "detections" / "a.json"
    assert source.is_file()
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero" if kind == "device" else source)
    assert cache.read(tmp_path / "cell", "a") is None


def test_cache_key_depends_on_all_inputs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The key depends on the target, the size, the image, the background image and the version of the detectors."""
    tags, board = TARGETS["tags"], TARGETS["charuco"]
    given = [
        (tags, (640, 480), b"image", None),
        (board, (640, 480), b"image", None),
        (tags, None, b"image", None),
        (tags, (640, 480), b"other", None),
        (tags, (640, 480), b"image", b"dark"),
        (tags, (640, 480), b"imagedark", None),
    ]
    names = {cache.key(*each) for each in given}
    assert len(names) == len(given)
    assert cache.key(*given[0]) in names
    monkeypatch.setattr(cache, "VERSION", cache.VERSION + 1)
    assert cache.key(*given[0]) not in names


@pytest.mark.parametrize(
    "text",
    [
        '{"ids": [1], "pixels": [[1, NaN]], "sigma_px": [0.1]}',
        '{"ids": [1], "pixels": [[1, 2]], "sigma_px": [0]}',
        '{"ids": [1, 2], "pixels": [[1, 2]], "sigma_px": [0.1]}',
        '{"ids": [1], "pixels": [[1, 2], [3, 4]], "sigma_px": [0.1]}',
        '{"ids": [1], "pixels": [], "sigma_px": []}',
        f'{{"ids": [1], "pixels": [[1, 1{"0" * 400}]], "sigma_px": [0.1]}}',
        f'{{"ids": [1{"0" * 30}], "pixels": [[1, 2]], "sigma_px": [0.1]}}',
        "[" * 100_000,
        "\x00",
    ],
)
def test_damaged_cache_file_is_ignored(text: str, tmp_path: Path) -> None:
    """A cached file that differs from what was written is treated as missing."""
    cache.write(tmp_path, "a", FOUND)
    (path,) = (tmp_path / "derived" / "detections").iterdir()
    path.write_text(text)
    assert cache.read(tmp_path, "a") is None
