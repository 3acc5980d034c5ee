"""The number of squares of a ChArUco board, from the positions of its markers, whose numbers count row by row."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.fiducials import smallest_dictionary
from basecal.geometry import Array
from basecal.vision.kinds.preprocessing import MARKER_SETS, Grey, detect_markers, dictionary, marker_corners

_FEWEST_MARKERS = 6  # markers that distinguish boards: any four points are consistent with a homography
_MOST_COLUMNS = 40
_BOARD_TRIES = 3  # boards to try
_NEAR_SHARE = 0.2  # of the distance to the next marker: distortion of a wide lens is less

MarkerCentres = Mapping[int, Array]  # centres of markers, (2,) [px], by number


def likely_boards(images: Sequence[Grey], target: Target) -> Iterator[Target]:
    """Boards whose markers fit the images, best first; each is the smallest that has all the numbers seen.

    Args:
        images: Images in which the board is not found.
        target: The stated board, whose lengths are kept.
    """
    names = next((names for names in MARKER_SETS if target.options["dictionary"] in names), ())
    if not names:
        return
    detector = cv2.aruco.ArucoDetector(dictionary(names[-1]))
    centres_by_image: list[MarkerCentres] = []
    for image in images:
        numbers, quads = detect_markers(detector, image)
        centres_by_image.append(dict(zip(numbers.tolist(), quads.mean(1), strict=True)))
    largest = max(centres_by_image, key=len, default={})
    if len(largest) < _FEWEST_MARKERS:
        return
    highest = max(max(each) for each in centres_by_image if each)
    name = smallest_dictionary(target.options["dictionary"], highest + 1)
    errors = {board: _layout_error(board, largest) for board in _boards(target, name, highest)}
    likely = [board for board in errors if errors[board] < _NEAR_SHARE]
    yield from sorted(likely, key=lambda board: errors[board])[:_BOARD_TRIES]


def _boards(target: Target, name: str, highest: int) -> Iterator[Target]:
    options = target.options
    for columns in range(3, _MOST_COLUMNS):
        fewest = -(-2 * (highest + 1) // columns)
        for rows, legacy in product((fewest, fewest + 1), (False, True)):
            if rows >= 3 and highest < columns * rows // 2 <= len(dictionary(name).bytesList):
                yield charuco_target((columns, rows), options["square_m"], options["marker_m"], name, legacy)


def _layout_error(board: Target, markers: MarkerCentres) -> float:
    """Rms residual of markers after a homography from a board, in units of the smallest distance between markers."""
    numbers = sorted(markers)
    plane = marker_corners(board)[numbers].mean(1) / board.options["square_m"]
    pixels = np.array([markers[number] for number in numbers])
    image_from_plane, _ = cv2.findHomography(plane, pixels)
    if image_from_plane is None:
        return float("inf")
    predicted = cv2.perspectiveTransform(plane[:, None], image_from_plane)[:, 0]
    distances = np.linalg.norm(pixels[:, None] - pixels, axis=-1)[~np.eye(len(pixels), dtype=bool)]
    return float(np.sqrt(np.mean(np.sum((predicted - pixels) ** 2, -1)))) / max(float(distances.min()), 1e-9)
