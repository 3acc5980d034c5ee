"""Features that are kept between runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.vision.tracks import feature_cache
from basecal.vision.tracks.feature_cache import kept_features
from basecal.vision.tracks.features import Features

IMAGE = np.random.default_rng(1).integers(0, 255, (60, 80)).repeat(2, 0).repeat(2, 1).astype(np.uint8)
SQUARE = np.array([[20.0, 20.0], [60.0, 20.0], [60.0, 60.0]])


def kept_files(folder: Path) -> list[Path]:
    """What is kept."""
    return sorted((folder / "derived" / "features").iterdir())


def test_kept_features_equal_those_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second call reads the file, finds nothing anew, and gives the same to the last bit."""
    first = kept_features(tmp_path, "key", IMAGE, [])
    assert len(first) > 50

    def fail(*_: object) -> Features:
        raise AssertionError("features are found again")

    monkeypatch.setattr(feature_cache, "find_features", fail)
    again = kept_features(tmp_path, "key", IMAGE, [])
    np.testing.assert_array_equal(again.pixels, first.pixels)
    np.testing.assert_array_equal(again.descriptors, first.descriptors)
    np.testing.assert_allclose(np.linalg.norm(again.descriptors, axis=1), 1.0, atol=1e-5)


def test_another_image_or_mask_is_another_file(tmp_path: Path) -> None:
    """The name holds the hash of the image and of what covers it."""
    for key, covered in (("key", []), ("other", []), ("key", [SQUARE]), ("key", [])):
        kept_features(tmp_path, key, IMAGE, covered)
    assert len(kept_files(tmp_path)) == 3


@pytest.mark.parametrize("broken", [b"x" * 17, np.full(2, np.nan).tobytes() + bytes(128)])
def test_a_broken_file_is_no_file(tmp_path: Path, broken: bytes) -> None:
    """Of a wrong length or with places that are no numbers: features are found and kept again."""
    first = kept_features(tmp_path, "key", IMAGE, [])
    (path,) = kept_files(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(broken)
    assert len(kept_features(tmp_path, "key", IMAGE, [])) == len(first)
    assert path.read_bytes() == whole


def test_a_folder_that_takes_no_files_is_only_slower(tmp_path: Path) -> None:
    """Where `derived` is a file features are found all the same."""
    (tmp_path / "derived").write_text("")
    assert len(kept_features(tmp_path, "key", IMAGE, [])) > 50
