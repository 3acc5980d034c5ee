"""Preprocessing of images with blurred, dark or small targets: another scale, stretched levels, sharpening."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sized
from functools import cache
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.cell.target import Target
from basecal.cell.targets.fiducials import smallest_dictionary
from basecal.errors import InputError
from basecal.geometry import Array, BoolArray, IntArray

_DARK_BRIGHT_PERCENT = (1, 99)  # levels that become black and white, excluding reflections, lamps and dead pixels
_LEVEL_STRIDE = 4  # rows and columns between the pixels that determine these levels
_BLUR_PX, _SHARPENING_GAIN = 3.0, 1.5  # of unsharp masking, with which markers blurred by 3 px are read
_MOST_PIXELS = 2**22  # of an enlarged image: 4 megapixels resolve all targets, and more take seconds
_LEAST_SIDE_PX = 16  # of any image: OpenCV's detectors fail with less

Grey = NDArray[np.uint8]
S = TypeVar("S", bound=Sized)
_FAMILY = re.compile(r"tag(16h5|25h9|36h10|36h11)")

_SIZES = (50, 100, 250, 1000)
MARKER_SETS = (
    *(tuple(f"DICT_{cells}X{cells}_{size}" for size in _SIZES) for cells in (4, 5, 6, 7)),
    *(
        (name,)
        for name in ("DICT_ARUCO_ORIGINAL", "DICT_ARUCO_MIP_36h12", "tag16h5", "tag25h9", "tag36h10", "tag36h11")
    ),
)
"""OpenCV's dictionaries; those of one tuple are prefixes of its last."""


class Preprocessing(NamedTuple):
    """A preprocessing of an image before the search.

    Attributes:
        scale: Scale factor of its sides.
        stretched: Whether its levels are stretched to the full range.
        sharpened: Whether it is sharpened.
    """

    scale: float = 1.0
    stretched: bool = False
    sharpened: bool = False

    def suits(self, image: Grey) -> bool:
        """Whether the size of an image suits this preprocessing."""
        sides = [round(self.scale * side) for side in image.shape]
        return min(sides) >= _LEAST_SIDE_PX and (self.scale <= 1 or sides[0] * sides[1] <= _MOST_PIXELS)

    def apply(self, image: Grey) -> Grey:
        """Preprocess an image."""
        if self.stretched:
            low, high = np.percentile(image[::_LEVEL_STRIDE, ::_LEVEL_STRIDE], _DARK_BRIGHT_PERCENT)
            levels = (np.arange(256) - low) * (255.0 / max(high - low, 1.0))
            image = np.asarray(cv2.LUT(image, np.clip(np.rint(levels), 0, 255).astype(np.uint8)), np.uint8)
        if self.scale != 1:
            kind = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_CUBIC
            image = np.asarray(cv2.resize(image, None, fx=self.scale, fy=self.scale, interpolation=kind), np.uint8)
        if self.sharpened:
            blurred = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
            image = np.asarray(cv2.addWeighted(image, 1 + _SHARPENING_GAIN, blurred, -_SHARPENING_GAIN, 0), np.uint8)
        return image

    def original_pixels(self, pixels: object) -> Array:
        """Convert pixels of the preprocessed image to the original image, (n, 2) [px]."""
        points = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        return (points + 0.5) / self.scale - 0.5


MARKER_PREPROCESSINGS = (
    Preprocessing(),
    Preprocessing(stretched=True),
    Preprocessing(stretched=True, sharpened=True),
    Preprocessing(2.0, stretched=True),
)
"""Preprocessings for markers: for typical images, dark ones, blurred ones, and small markers."""


def best_result(
    image: Grey,
    preprocessings: Iterable[Preprocessing],
    search: Callable[[Grey, Preprocessing], S],
    enough_count: float,
) -> S | None:
    """Search with each preprocessing until one finds enough, and return the largest result; None if all are empty.

    Args:
        image: (h, w).
        preprocessings: The preprocessings, fastest first.
        search: Function that searches a preprocessed image.
        enough_count: Size of a result that ends the search.
    """
    largest: S | None = None
    for preprocessing in preprocessings:
        if not preprocessing.suits(image):
            continue
        result = search(preprocessing.apply(image), preprocessing)
        if len(result) > (0 if largest is None else len(largest)):
            largest = result
        if len(result) >= enough_count:
            break
    return largest


@cache
def dictionary(name: str) -> Any:
    """OpenCV's dictionary with a name such as `DICT_4X4_50` or `tag36h11`.

    Raises:
        InputError: if OpenCV has no dictionary with that name.
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
    ids = np.asarray(() if numbers is None else numbers, dtype=np.int64).ravel()
    return ids, np.asarray(quads if len(ids) else (), dtype=np.float64).reshape(-1, 4, 2)


def black_cells(dictionary_name: str, marker: int, border: int = 1) -> BoolArray:
    """Mask of a marker's black cells with its border, (cells, cells) by row and column.

    Raises:
        InputError: if the dictionary is not known or has no such marker.
    """
    markers = dictionary(dictionary_name)
    count = len(markers.bytesList)
    if marker >= count:
        raise InputError(f"{dictionary_name} has markers 0 to {count - 1}, not {marker}")
    black: BoolArray = markers.generateImageMarker(marker, markers.markerSize + 2 * border, None, border) == 0
    return black


def charuco_board(target: Target) -> Any:
    """OpenCV's board for a ChArUco target.

    Raises:
        InputError: if its dictionary has too few markers.
    """
    options = target.options
    markers = dictionary(options["dictionary"])
    needed = options["squares"][0] * options["squares"][1] // 2
    if needed > len(markers.bytesList):
        size = "x".join(map(str, options["squares"]))
        problem = f"{options['dictionary']} has {len(markers.bytesList)} markers, a {size} board needs {needed}"
        larger = smallest_dictionary(options["dictionary"], needed)
        remedy = f": write `dictionary: {larger}`, which begins with the same"
        raise InputError(f"{problem}{remedy if larger != options['dictionary'] else ''}")
    board = cv2.aruco.CharucoBoard(tuple(options["squares"]), options["square_m"], options["marker_m"], markers)
    board.setLegacyPattern(bool(options.get("legacy_pattern", False)))
    return board


def marker_corners(target: Target) -> Array:
    """Corners of a ChArUco board's markers in the board's plane, (markers, 4, 2) [m], by marker id.

    Raises:
        InputError: if its dictionary has too few markers.
    """
    return np.asarray(charuco_board(target).getObjPoints(), dtype=np.float64)[..., :2]
