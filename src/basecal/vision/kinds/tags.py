"""AprilTags and ArUco markers: OpenCV reads them, each corner is then refined in the image.

In a grid with black squares at the tags' corners the outlines merge, so that OpenCV misses some tags. These are
searched at positions predicted from neighbouring tags, and accepted if all four corners can be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import cv2
import numpy as np

from basecal.cell.target import Tags, Target
from basecal.geometry import Array, BoolArray, IntArray
from basecal.vision.detection import Detection, Image, eight_bit, make_detection
from basecal.vision.fit.corner_shapes import saddle, wedge
from basecal.vision.fit.corners import BOARD_ARM_PX, Window, refine_corners
from basecal.vision.kinds.preprocessing import (
    MARKER_PREPROCESSINGS,
    Grey,
    Preprocessing,
    best_result,
    detect_markers,
    dictionary,
)

_TAG_CORNERS = 4
_ENOUGH_SHARE = (
    0.7  # of the tags: with fewer the image may be blurred, dark or the tags small, and other ways are tried
)
_ARM_PX = 12.0  # along a tag's edges, which end at its corner: distortion bends them less than continued lines
_ARM_SHARE = 0.5  # of a tag's side: the other half of an edge belongs to its other corner
_NEIGHBOUR_PITCHES = 1.5  # pitches between tags that are adjacent by side or corner
_GUIDE_COUNT = 3  # nearest tags that predict a position: with more, distortion has more effect


def detect(image: Image, target: Target) -> Detection | None:
    """Detect the corners of a target's tags; None if there are none.

    Tags that appear twice in the image are left out.

    Args:
        image: (h, w), uint8 or uint16.
        target: A target with `tags`.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits, or OpenCV does not know the family.
    """
    if target.tags is None:
        return None
    # Programs print borders of different widths: the other width is tried if the stated one gives nothing.
    for border in (target.tags.border, 3 - target.tags.border):
        search = _Search(np.asarray(image), target.tags, dictionary(target.tags.family).markerSize + 2 * border, border)
        enough_count = _ENOUGH_SHARE * len(search.tags.numbers)
        quads = best_result(eight_bit(image), MARKER_PREPROCESSINGS, partial(_quads, search), enough_count)
        if quads is None:
            continue
        tags_found = _fit_quads(search, np.array(list(quads)), np.stack(list(quads.values())))
        if target.tags.squares:
            tags_found = _grow_grid(search, target, tags_found)
        if tags_found.trusted.any():
            ids, kept = target.tags.corner_ids[tags_found.rows], tags_found.trusted
            return make_detection(ids[kept], tags_found.pixels[kept], tags_found.sigma_px[kept])
    return None


def _quads(search: _Search, image: Grey, preprocessing: Preprocessing) -> dict[int, Array]:
    """Corners, (4, 2) [px], of tags that are read exactly once, by their row in the target's tags."""
    numbers, quads = detect_markers(_detector(search.tags.family, search.border), image)
    distinct, first, count = np.unique(numbers, return_index=True, return_counts=True)
    _, rows, indices = np.intersect1d(search.tags.numbers, distinct[count == 1], return_indices=True)
    once = first[count == 1][indices]
    return {int(row): preprocessing.original_pixels(quads[k]) for row, k in zip(rows, once, strict=True)}


@cache
def _detector(family: str, border: int) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    return cv2.aruco.ArucoDetector(dictionary(family), parameters)


class _Search(NamedTuple):
    """An image, the tags to find, the number of cells across a tag, and the width of its border in cells."""

    image: Image
    tags: Tags
    cells: int
    border: int


@dataclass(frozen=True, eq=False)
class _FoundTags:
    """Tags: rows in the target's tags, (k,), pixels, (k, 4, 2), their sigmas and whether to trust each, (k, 4)."""

    rows: IntArray
    pixels: Array
    sigma_px: Array
    trusted: BoolArray

    def __getitem__(self, rows: BoolArray) -> _FoundTags:
        return _FoundTags(self.rows[rows], self.pixels[rows], self.sigma_px[rows], self.trusted[rows])

    @property
    def trusted_tags(self) -> _FoundTags:
        """Tags with four trusted corners."""
        return self[np.asarray(self.trusted.all(axis=1))]

    def concatenate(self, additions: _FoundTags) -> _FoundTags:
        """These tags and more."""
        rows, pixels = np.concatenate([self.rows, additions.rows]), np.concatenate([self.pixels, additions.pixels])
        sigma_px = np.concatenate([self.sigma_px, additions.sigma_px])
        return _FoundTags(rows, pixels, sigma_px, np.concatenate([self.trusted, additions.trusted]))


def _fit_quads(search: _Search, rows: IntArray, quads: Array) -> _FoundTags:
    """Refine the corners of tags near `quads`, (k, 4, 2) [px]."""
    axes = search.cells * np.array([_first_cells(quad, search.cells) for quad in quads]).reshape(-1, 2, 2)
    inside, square = search.border / search.cells, search.tags.squares
    if not square:
        # Dark inside and bright outside, for the width of a cell.
        window = Window(arm_px=_ARM_PX, arm=_ARM_SHARE, inside=inside, outside=np.inf, before=1 / search.cells)
        corners = refine_corners(search.image, wedge, quads.reshape(-1, 2), axes, window)
        trusted = corners.trusted
    else:
        # Black squares touch the corners: dark inside the tag and opposite to it; otherwise it is another position.
        window = Window(arm_px=BOARD_ARM_PX, arm=_ARM_SHARE, inside=inside, outside=square, before=square)
        corners = refine_corners(search.image, saddle, quads.reshape(-1, 2), axes, window)
        trusted = corners.trusted & (corners.gain < 0)
    shape = (len(quads), _TAG_CORNERS)
    pixels, sigma_px = corners.pixels.reshape(*shape, 2), corners.sigma_px.reshape(shape)
    return _FoundTags(rows, pixels, sigma_px, trusted.reshape(shape))


def _first_cells(quad: Array, cells: int) -> Array:
    """Images of a cell's side along both lines of each corner, under perspective, (4, 2, 2) [px]."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    image_from_square = cv2.getPerspectiveTransform(square, quad.astype(np.float32))
    lines = np.stack([np.roll(square, -1, axis=0) - square, np.roll(square, 1, axis=0) - square], axis=1)
    ends = (square[:, None] + lines / cells).reshape(1, -1, 2)
    return np.asarray(cv2.perspectiveTransform(ends, image_from_square)).reshape(4, 2, 2) - quad[:, None]


def _grow_grid(search: _Search, target: Target, first_tags: _FoundTags) -> _FoundTags:
    """Trusted tags of a flat grid, extended repeatedly by their neighbours at predicted positions.

    A tag with an untrusted corner is searched like a missing tag; if that fails, its trusted corners are kept.
    """
    corners = target.points[target.rows(search.tags.corner_ids.ravel()), :2].reshape(-1, _TAG_CORNERS, 2)
    centres = corners.mean(axis=1)
    reach = _NEIGHBOUR_PITCHES * (1 + search.tags.squares) * float(np.linalg.norm(corners[0, 1] - corners[0, 0]))
    trusted = first_tags.trusted_tags
    tried = np.zeros(len(corners), dtype=bool)
    tried[trusted.rows] = True
    while True:
        distances = np.linalg.norm(centres[:, None] - centres[trusted.rows], axis=2)
        neighbours = np.flatnonzero(~tried & (distances < reach).any(axis=1))
        if not len(neighbours):
            return trusted.concatenate(first_tags[~np.isin(first_tags.rows, trusted.rows)])
        tried[neighbours] = True
        guides = np.argsort(distances[neighbours], axis=1)[:, :_GUIDE_COUNT]
        known, start = corners[trusted.rows], []
        for k, near in zip(neighbours, guides, strict=True):
            image_from_plane, _ = cv2.findHomography(known[near].reshape(-1, 2), trusted.pixels[near].reshape(-1, 2))
            start.append(cv2.perspectiveTransform(corners[k][None], image_from_plane)[0].astype(np.float64))
        more = _fit_quads(search, neighbours, np.stack(start))
        trusted = trusted.concatenate(more.trusted_tags)
