"""Folders of images: listing in natural order, image sizes, and times from file names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from basecal.bounded_file import check_regular
from basecal.cell.journal.recording_file import MOST_SAMPLES
from basecal.errors import DatasetError, InputError, list_names
from basecal.vision.image_header import SIGNATURES, read_header

ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm")
"""Extensions of readable images, in lower case."""

_OTHER_IMAGES = frozenset(
    (".heic", ".heif", ".gif", ".raw", ".cr2", ".cr3", ".nef", ".arw", ".dng", ".exr", ".jp2", ".avif", ".npy")
) | {".mp4", ".avi", ".mov", ".mkv", ".bag", ".mcap"}
_HEADER_BYTES = 2**24  # bytes read to find the image's size; metadata before it are shorter
_PARTS = re.compile(r"(\d+)")
_STAMP = re.compile(r"(\d+)(?:[._](\d+))?")
# Number of digits before the point of a time since 1970, and the unit [s].
_SINCE_1970 = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
_NANOSECOND_DIGITS = 9
_FEWEST_NUMBERED = 3  # names needed to recognise a numbering


def list_images(folder: Path) -> tuple[Path, ...]:
    """List the images of a folder in natural order: 2.png before 10.png.

    Raises:
        DatasetError: if the folder does not exist or has no images; the message lists its content.
    """
    if not folder.is_dir():
        raise DatasetError(folder, "is not a folder; give the folder of one camera's images")
    files = [path for path in folder.iterdir() if not path.name.startswith(".")]
    found = [path for path in files if path.suffix.lower() in ENDINGS and path.is_file()]
    if not found:
        subfolders = [
            each.name for each in files if each.is_dir() and any(p.suffix.lower() in ENDINGS for p in each.iterdir())
        ]
        if subfolders:
            what = f"holds no images, only folders of images: {list_names(sorted(subfolders))}; import one at a time"
            raise DatasetError(folder, what)
        others = Counter(path.suffix.lower() or "no ending" for path in files if path.is_file())
        content = ", ".join(f"{count} of {ending}" for ending, count in others.most_common(3)) or "nothing"
        expected = f"expected {', '.join(ENDINGS)}"
        raise DatasetError(folder, f"holds no supported images: {content}; {expected}")
    if len(found) > MOST_SAMPLES:
        raise DatasetError(folder, f"{len(found)} images, expected at most {MOST_SAMPLES}")
    return tuple(sorted(found, key=natural_order))


def is_image(path: Path) -> bool:
    """Whether a file has the extension of an image."""
    return path.suffix.lower() in ENDINGS


def check_image(path: Path) -> None:
    """Check that a file has the header of an image, so that no other file is copied as an image.

    Raises:
        DatasetError: if the file is not an image or cannot be read.
    """
    check_regular(path)
    with path.open("rb") as file:
        if not file.read(max(map(len, SIGNATURES))).startswith(SIGNATURES):
            raise DatasetError(path, f"is not an image, despite its name; expected {', '.join(ENDINGS)}")


def unreadable_images(folder: Path) -> tuple[str, ...]:
    """Names of files in a folder with unsupported formats of images or films."""
    return tuple(sorted(path.name for path in folder.iterdir() if path.suffix.lower() in _OTHER_IMAGES))


def usual_size(sizes: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Most frequent size of images; the first one in case of a tie."""
    return Counter(sizes).most_common(1)[0][0]


def image_size(path: Path) -> tuple[int, int] | None:
    """Read width and height of an image [px]; None if they cannot be read."""
    try:
        with path.open("rb") as file:
            found = read_header(file.read(_HEADER_BYTES))
    except OSError:
        return None
    return None if found is None else found.size_px


def read_times(paths: Sequence[Path]) -> list[float]:
    """Parse the times [s] in the names of one camera's images, such as 1682512345.123.png or 1682512345123456789.png.

    Ten digits before the point are seconds since 1970, 13 milliseconds, 16 microseconds and 19 nanoseconds. Fewer than
    ten, with a point, are seconds from an arbitrary origin; with an underscore they may be a date or a number. After
    the point are decimals, or nanoseconds without leading zeros if up to nine digits are there, and not always nine.

    Raises:
        InputError: if a name is not a time.
    """
    lengths = {len(found[2]) for path in paths if (found := _STAMP.fullmatch(path.stem)) and found[2]}
    has_nanoseconds = len(lengths) > 1 and max(lengths) == _NANOSECOND_DIGITS
    return [_read_time(path, _NANOSECOND_DIGITS if has_nanoseconds else 0) for path in paths]


def _read_time(path: Path, width: int) -> float:
    """Parse one name; the digits after the point are padded with leading zeros to a width."""
    found = _STAMP.fullmatch(path.stem)
    if found is not None:
        whole, part = found[1], (found[2] or "0").rjust(width, "0")
        if len(whole) in _SINCE_1970:
            return float(f"{whole}.{part}") * _SINCE_1970[len(whole)]
        if "." in path.stem and len(whole) < min(_SINCE_1970):
            return float(f"{whole}.{part}")
    raise InputError(f"{path}: the name is not a time, expected a name such as 1682512345.123.png")


def missing_numbers(names: Sequence[str]) -> tuple[str, ...]:
    """Missing numbers between the first and last of numbered names; empty if names are not numbered or gaps are many.

    Args:
        names: Names of images, such as `0001.png`.
    """
    found = [re.search(r"(\d+)\D*$", Path(name).stem) for name in names]
    numbers = {int(each[1]): len(each[1]) for each in found if each is not None}
    if len(numbers) < len(names) or len(names) < _FEWEST_NUMBERED:
        return ()
    gaps = sorted(set(range(min(numbers), max(numbers))) - numbers.keys()) if max(numbers) < 2 * len(names) else []
    return tuple(f"{gap:0{min(numbers.values())}d}" for gap in gaps)


def natural_order(path: Path) -> tuple[tuple[int | str, ...], str]:
    """Sort key that compares numbers in names by value."""
    parts = _PARTS.split(path.stem.lower())
    return tuple(int(part) if i % 2 else part for i, part in enumerate(parts)), path.name
