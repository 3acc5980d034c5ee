"""Black and white cells of markers and boards, as OpenCV defines them."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.cell.target import Target
from basecal.cell.targets.fiducials import smallest_dictionary
from basecal.errors import InputError
from basecal.geometry import Array, BoolArray, IntArray

_FAMILY = re.compile(r"tag(16h5|25h9|36h10|36h11)")

_SIZES = (50, 100, 250, 1000)
MARKER_SETS = (
    *(tuple(f"DICT_{cells}X{cells}_{size}" for size in _SIZES) for cells in (4, 5, 6, 7)),
    *(
        (name,)
        for name in ("DICT_ARUCO_ORIGINAL", "DICT_ARUCO_MIP_36h12", "tag16h5", "tag25h9", "tag36h10", "tag36h11")
    ),
)
"""Dictionaries that OpenCV knows; those of one tuple are the beginning of its last."""


@cache
def dictionary(name: str) -> Any:
    """OpenCV's dictionary of a name such as `DICT_4X4_50` or `tag36h11`.

    Raises:
        InputError: if OpenCV has none of that name.
    """
    family = _FAMILY.fullmatch(name)
    number = getattr(cv2.aruco, f"DICT_APRILTAG_{family[1]}" if family else name, None)
    if number is None:
        known = "DICT_..., tag16h5, tag25h9, tag36h10 and tag36h11"
        raise InputError(f"tags of {name!r} can be neither drawn nor detected; use one of {known}")
    return cv2.aruco.getPredefinedDictionary(number)


def detect_markers(detector: Any, image: NDArray[np.uint8]) -> tuple[IntArray, Array]:
    """Numbers of the markers that OpenCV reads in an image, (n,), and their corners, (n, 4, 2) [px]."""
    quads, numbers, _ = detector.detectMarkers(image)
    found = np.asarray(() if numbers is None else numbers, dtype=np.int64).ravel()
    return found, np.asarray(quads if len(found) else (), dtype=np.float64).reshape(-1, 4, 2)


def black_cells(dictionary_name: str, marker: int, border: int = 1) -> BoolArray:
    """Which cells of a marker are black, its border among them, (cells, cells) by row and column.

    Raises:
        InputError: if the dictionary is not known or has no such marker.
    """
    known = dictionary(dictionary_name)
    count = len(known.bytesList)
    if marker >= count:
        raise InputError(f"{dictionary_name} has markers 0 to {count - 1}, not {marker}")
    black: BoolArray = known.generateImageMarker(marker, known.markerSize + 2 * border, None, border) == 0
    return black


def charuco_board(target: Target) -> Any:
    """OpenCV's board of a ChArUco target.

    Raises:
        InputError: if its dictionary has too few markers.
    """
    of = target.options
    known = dictionary(of["dictionary"])
    needed = of["squares"][0] * of["squares"][1] // 2
    if needed > len(known.bytesList):
        size = "x".join(map(str, of["squares"]))
        few = f"{of['dictionary']} has {len(known.bytesList)} markers, a {size} board needs {needed}"
        larger = smallest_dictionary(of["dictionary"], needed)
        mend = f": write `dictionary: {larger}`, which begins with the same" if larger != of["dictionary"] else ""
        raise InputError(f"{few}{mend}")
    board = cv2.aruco.CharucoBoard(tuple(of["squares"]), of["square_m"], of["marker_m"], known)
    board.setLegacyPattern(bool(of.get("legacy_pattern", False)))
    return board


def marker_corners(target: Target) -> Array:
    """Corners of a ChArUco board's markers in the board's plane, (markers, 4, 2) [m], by marker id.

    Raises:
        InputError: if its dictionary has too few markers.
    """
    return np.asarray(charuco_board(target).getObjPoints(), dtype=np.float64)[..., :2]
