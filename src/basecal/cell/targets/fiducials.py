"""Names of the marker dictionaries that OpenCV 4 knows, and of the AprilTag families."""

from __future__ import annotations

import re
from math import isqrt

_ORIGINAL = 5  # cells of the first ArUco dictionary, whose name does not say

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
    """How many cells the code of a marker is wide, its border not counted, as the dictionary's name says."""
    squared = re.match(r"DICT_(\d)X", name)
    bits = re.search(r"(\d+)[hH]", name)
    return int(squared[1]) if squared else isqrt(int(bits[1])) if bits else _ORIGINAL


def begins_as(name: str) -> str:
    """Markers that two dictionaries share, one of which is the beginning of the other."""
    numbered = re.match(r"(DICT_\d+X\d+)_\d+$", name)
    return numbered[1] if numbered else name


def smallest_dictionary(name: str, count: int) -> str:
    """The smallest dictionary of so many markers that begins as one of this name; it itself where none does."""
    for other in DICTIONARIES:
        size = other.rpartition("_")[2]
        if other == f"{begins_as(name)}_{size}" and int(size) >= max(count, int(name.rpartition("_")[2])):
            return other
    return name
