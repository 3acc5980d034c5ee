"""Tests of folders of images."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange import images
from basecal.exchange.images import (
    check_image,
    image_size,
    is_image,
    list_images,
    missing_numbers,
    natural_order,
    read_times,
    unreadable_images,
    usual_size,
)


def fill_folder(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    return folder


def test_images_are_sorted_numerically(tmp_path: Path) -> None:
    """2 precedes 10, with or without leading zeros; hidden and other files are skipped."""
    fill_folder(tmp_path, "img10.png", "img2.JPG", "img001.png", ".img0.png", "notes.txt")
    assert [path.name for path in list_images(tmp_path)] == ["img001.png", "img2.JPG", "img10.png"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ((), ": nothing; expected .png"),
        (("a.raw", "b.raw", "c.txt"), ": 2 of .raw, 1 of .txt; expected .png"),
        (("left/a.png", "right/a.png"), "folders of images: left, right; import one at a time"),
    ],
)
def test_folder_without_images_lists_its_contents(tmp_path: Path, names: tuple[str, ...], message: str) -> None:
    """The error lists other file endings, or folders of images inside."""
    with pytest.raises(DatasetError, match=message):
        list_images(fill_folder(tmp_path, *names))


def test_file_in_place_of_folder_is_refused(tmp_path: Path) -> None:
    """A file and a missing folder are refused."""
    for name in ("a.png", "none"):
        with pytest.raises(DatasetError, match="is not a folder"):
            list_images(fill_folder(tmp_path, "a.png") / name)


def test_unreadable_image_formats_are_listed(tmp_path: Path) -> None:
    """Files that look like images or films are listed; text files are not."""
    assert unreadable_images(fill_folder(tmp_path, "a.png", "b.HEIC", "c.mp4", "d.txt")) == ("b.HEIC", "c.mp4")


@pytest.mark.parametrize(
    ("name", "stamp"),
    [
        ("1682512345.25.png", 1682512345.25),
        ("1682512345_250000.png", 1682512345.25),
        ("1682512345250.png", 1682512345.25),
        ("1682512345250000.png", 1682512345.25),
        ("1682512345250000000.png", 1682512345.25),
        ("left/12.5.png", 12.5),
    ],
)
def test_image_names_are_read_as_times(name: str, stamp: float) -> None:
    """Times since 1970 are read in the unit that their digit count implies.

    Names with a point may start at any time.
    """
    assert read_times([Path(name)]) == [pytest.approx(stamp, abs=1e-6)]


@pytest.mark.parametrize("separator", "._")
def test_nanoseconds_without_leading_zeros_are_read(separator: str) -> None:
    """ROS names have unpadded seconds and nanoseconds: 5 ms after the second was read as half a second."""
    names = [f"1682512345{separator}{part}.png" for part in ("5000000", "105000000", "205000000")]
    assert read_times([Path(name) for name in names]) == pytest.approx(
        [1682512345.005, 1682512345.105, 1682512345.205], abs=1e-6
    )
    decimals = [Path(f"1682512345{separator}{part}.png") for part in ("5", "605", "705")]
    assert read_times(decimals) == pytest.approx([1682512345.5, 1682512345.605, 1682512345.705], abs=1e-6)


@pytest.mark.parametrize("name", ["000012.png", "img12.5.png", "12345678901.png", "20260501_123000.png", "3_12.png"])
def test_plain_numbers_are_not_times(name: str) -> None:
    """The error shows a valid name. Before, a date was read as seconds, and image 12 of view 3 preceded image 5."""
    with pytest.raises(InputError, match=re.escape(f"{name}: the name is not a time, expected a name such as 16825")):
        read_times([Path(name)])


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (("1.png", "2.png", "4.png"), ("3",)),
        (("left_0001.png", "left_0004.png", "left_0003.png"), ("0002",)),
        (("1.png", "3.png"), ()),  # two names are no numbering
        (("1.png", "2.png", "last.png", "4.png"), ()),
        (("10.png", "2.png", "4.png"), ()),  # unrelated numbers
    ],
)
def test_missing_image_numbers_are_listed(names: tuple[str, ...], missing: tuple[str, ...]) -> None:
    """Gaps are listed if three or more names all have numbers with few gaps."""
    assert missing_numbers(names) == missing


def test_usual_size_is_most_frequent() -> None:
    """The usual size is the most frequent one."""
    assert usual_size([(4, 3), (8, 6), (8, 6)]) == (8, 6)


def test_image_size_is_read_from_header(tmp_path: Path) -> None:
    """A file that is not an image, or is missing, has no size."""
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((48, 64), np.uint8))
    (tmp_path / "b.png").write_bytes(b"no image")
    assert image_size(tmp_path / "a.png") == (64, 48)
    assert image_size(tmp_path / "b.png") is None
    assert image_size(tmp_path / "c.png") is None


def test_image_size_is_found_after_long_metadata(tmp_path: Path) -> None:
    """A JPEG with a megabyte of segments before its frame has its size read."""
    path = tmp_path / "a.jpg"
    cv2.imwrite(str(path), np.zeros((48, 64), np.uint8))
    plain = path.read_bytes()
    segment = b"\xff\xe2" + (65_535).to_bytes(2, "big") + bytes(65_533)
    path.write_bytes(plain[:2] + 16 * segment + plain[2:])
    assert image_size(path) == (64, 48)


def test_file_contents_decide_on_image(tmp_path: Path) -> None:
    """A file is checked by its first bytes, however short it is; names are compared without case."""
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((4, 4), np.uint8))
    check_image(tmp_path / "a.png")
    (tmp_path / "b.png").write_bytes(b"P")
    with pytest.raises(DatasetError, match=r"is not an image, despite its name; expected \.png"):
        check_image(tmp_path / "b.png")
    assert [is_image(Path(name)) for name in ("a.PNG", "a.tif", "a.raw", "png")] == [True, True, False, False]


@pytest.mark.parametrize("count", [3, 4])
def test_image_count_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """A folder may have as many images as a recording; one more is refused."""
    monkeypatch.setattr(images, "MOST_SAMPLES", 3)
    fill_folder(tmp_path, *(f"{k}.png" for k in range(count)))
    if count == 3:
        assert len(list_images(tmp_path)) == 3
    else:
        with pytest.raises(DatasetError, match="4 images, expected at most 3"):
            list_images(tmp_path)


def test_most_frequent_endings_are_listed(tmp_path: Path) -> None:
    """Three endings are listed, most frequent first, without hidden files; folders without images are not listed."""
    fill_folder(tmp_path, "1.a", "2.a", "3.a", "1.b", "2.b", "1.c", "2.c", "1.d", "e/1.txt", ".f.png")
    with pytest.raises(DatasetError, match=r": 3 of \.a, 2 of \.b, 2 of \.c; expected"):
        list_images(tmp_path)
    fill_folder(tmp_path / "none", "bare")
    with pytest.raises(DatasetError, match=": 1 of no ending; expected"):
        list_images(tmp_path / "none")


def test_folder_named_like_image_is_skipped(tmp_path: Path) -> None:
    """Images beside such a folder are listed."""
    fill_folder(tmp_path, "a.png/1.txt", "b.png")
    assert [path.name for path in list_images(tmp_path)] == ["b.png"]


def test_equal_numbers_are_sorted_by_name() -> None:
    """Digits and letters are separated anywhere in a name, and case is ignored."""
    names = ["b1a2.png", "B1a10.png", "b01a2.png", "1.png", "a.png"]
    assert [path.name for path in sorted(map(Path, names), key=natural_order)] == [
        "1.png", "a.png", "b01a2.png", "b1a2.png", "B1a10.png",
    ]  # fmt: skip


def test_only_few_gaps_count_as_numbering(tmp_path: Path) -> None:
    """Numbers below twice their count are a numbering. Its gaps are printed with the fewest digits among the names."""
    assert missing_numbers(["1.png", "3.png", "5.png"]) == ("2", "4")
    assert missing_numbers(["1.png", "3.png", "6.png"]) == ()
    assert missing_numbers(["08.png", "09.png", "010.png", "11.png", "13.png", "6.png", "7.png"]) == ("12",)
    assert missing_numbers(["a1b.png", "a2b.png", "a4b.png"]) == ("3",)


def test_tie_of_image_sizes_goes_to_first() -> None:
    """If two sizes have two images each, the first one is used."""
    assert usual_size([(4, 3), (8, 6), (8, 6), (4, 3)]) == (4, 3)
