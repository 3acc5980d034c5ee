"""Detections that are kept."""

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
def test_read_as_written(detection: Detection | None, tmp_path: Path) -> None:
    """What is kept comes back to the last bit, that there was nothing too."""
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
def test_only_files_of_the_cell_are_read(tmp_path: Path, kind: str) -> None:
    """Neither a pipe, which would be waited for, nor what a link leads to outside."""
    cache.write(tmp_path / "outside", "a", FOUND)
    cache.write(tmp_path / "cell", "b", FOUND)
    path = tmp_path / "cell" / "derived" / "detections" / "a.json"
    source = tmp_path / "outside" / "derived" / "detections" / "a.json"
    assert source.is_file()
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero" if kind == "device" else source)
    assert cache.read(tmp_path / "cell", "a") is None


def test_key_holds_all_that_matters(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another target, size, image, image without the light or version of the detectors has another name."""
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
def test_broken_files_are_no_files(text: str, tmp_path: Path) -> None:
    """A kept file that is not what was written is as if it were not there."""
    cache.write(tmp_path, "a", FOUND)
    (path,) = (tmp_path / "derived" / "detections").iterdir()
    path.write_text(text)
    assert cache.read(tmp_path, "a") is None
