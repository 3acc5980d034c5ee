"""Poses of COLMAP's images, as text and as binary."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.colmap_images import read_colmap_images
from colmap_files import IMAGES, binary_images, text_images


@pytest.mark.parametrize("name", ["images.bin", "images.txt"])
def test_images_by_name(tmp_path: Path, name: str) -> None:
    """Numbers in names count as numbers; each has its camera and its pose."""
    content = {"images.bin": binary_images(IMAGES), "images.txt": text_images(IMAGES).encode()}[name]
    (tmp_path / name).write_bytes(content)
    found = read_colmap_images(tmp_path)
    assert [(image.name, image.camera) for image in found] == [("base.png", 2), ("wrist 9.png", 1), ("wrist 10.png", 1)]
    for image in found:
        truth = next(each for each in IMAGES if each.name == image.name)
        np.testing.assert_allclose(image.camera_from_world.matrix, truth.camera_from_world.matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("1 1 0 0 0 0 0 0", "images.txt:1: 8 words, expected IMAGE_ID QW"),
        ("1 1 0 0 0 0 0 x 1 a.png", "images.txt:1: '1 1 0 0 0 0 0 x 1 a.png' has a word that is not a number"),
        ("1 0.5 0 0 0 0 0 0 1 a.png", "QW QX QY QZ has length 0.5, expected 1"),
        ("1 1 0 0 0 0 0 nan 1 a.png", "holds a number that is not finite"),
        ("# nothing", "holds no image"),
    ],
)
def test_a_wrong_line(tmp_path: Path, line: str, says: str) -> None:
    """It is named with what was expected."""
    (tmp_path / "images.txt").write_text(line + "\n\n")
    with pytest.raises(DatasetError, match=re.escape(says)):
        read_colmap_images(tmp_path)


def test_a_binary_cut_anywhere(tmp_path: Path) -> None:
    """It is said to be cut off, or to hold fewer bytes than its counts say."""
    whole = binary_images(IMAGES)
    for size in range(len(whole)):
        (tmp_path / "images.bin").write_bytes(whole[:size])
        with pytest.raises(DatasetError, match="cut off"):
            read_colmap_images(tmp_path)


def test_a_folder_without_one(tmp_path: Path) -> None:
    """Both names are said."""
    with pytest.raises(DatasetError, match=r"neither images\.bin nor images\.txt"):
        read_colmap_images(tmp_path)
