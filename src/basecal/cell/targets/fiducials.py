"""Names of the marker dictionaries that OpenCV 4 knows, and of the AprilTag families."""

from __future__ import annotations

import re
from math import isqrt

_ORIGINAL_CELLS = 5  # cells of DICT_ARUCO_ORIGINAL, whose name does not include the number

DICTIONARIES = (
    *(f"DICT_{n}X{n}_{count}" for n in (4, 5, 6, 7) for count in (50, 100, 250, 1000)),
    "DICT_ARUCO_ORIGINAL",
    *(f"DICT_APRILTAG_{bits}{h}{distance}" for h in "hH" for bits, distance in ((16, 5), (25, 9), (36, 10), (36, 11))),
    "DICT_ARUCO_MIP_36h12",
    "DICT_ARUCO_MIP_36H12",
)

FAMILIES = (
    "tag16h5",
    "tag25h9",
    "tag36h10",
    "tag36h11",
    "tagCircle21h7",
    "tagCircle49h12",
    "tagCustom48h12",
    "tagStandard41h12",
    "tagStandard52h13",
)


def cell_count(name: str) -> int:
    """Width of a marker's code in cells without its border, from the dictionary's name."""
    width_match = re.match(r"DICT_(\d)X", name)
    bits_match = re.search(r"(\d+)[hH]", name)
    return int(width_match[1]) if width_match else isqrt(int(bits_match[1])) if bits_match else _ORIGINAL_CELLS


def series_name(name: str) -> str:
    """Name of the series of a dictionary: dictionaries of one series share their first markers."""
    match = re.match(r"(DICT_\d+X\d+)_\d+$", name)
    return match[1] if match else name


def smallest_dictionary(name: str, count: int) -> str:
    """Smallest dictionary of the same series with at least `count` markers; `name` itself if there is none."""
    for other in DICTIONARIES:
        size = other.rpartition("_")[2]
        if other == f"{series_name(name)}_{size}" and int(size) >= max(count, int(name.rpartition("_")[2])):
            return other
    return name
