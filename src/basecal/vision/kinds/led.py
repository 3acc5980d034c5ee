"""LEDs: bright spots, each with a fitted Gaussian; with an image of the LED off, spots in the difference."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.geometry import read_only, read_only_ids
from basecal.numerics.robust_step import NORMAL_MAD
from basecal.vision.detection import Detection, Image, check_image, full_scale
from basecal.vision.fit.spot_fit import Spot, fit_spot

_MOST_CANDIDATES = 8  # largest number for the choice among candidates by all views
_LEAST_HEIGHT_SHARE = 0.25  # of the brightest spot's height, which another candidate must reach
_NOISE_SIGMAS = 6.0  # sigmas above the median: normal noise exceeds it once in 1e9 pixels
_LEAST_STEP = 0.5  # levels above the median, if an image has no noise
_NOISE_STRIDE = 6  # rows and columns of the half-size image between the pixels that give median and noise
_LARGEST_PX = 48  # of a spot: larger bright areas are windows and walls
_LEAST_WIDTH_PX, _MOST_WIDTH_PX = 0.2, 16.0  # sigma of a spot: from a hot pixel to a third of the largest spot
_MOST_SIGMA_PX = 1.0  # of a position, above which the spot is rejected
_LEAST_DISTANCE_PX = 1.0  # between two spots, below which they are the same
# A Gaussian is 3.3 sigmas wide at a quarter of its height; five sigmas to both sides contain it with a margin.
_EXTENT_SIGMAS = 3.3
_REACH_EXTENTS, _REACH_MORE_PX = 1.4, 3
_FIRST_WIDTH_PX = 0.6  # smallest initial sigma: twice that of a pixel's square


def detect(image: Image, target: Target, background: Image | None = None) -> Detection | None:
    """Detect the LED; several bright spots are candidates without ids, brightest first; None if there is no spot.

    Args:
        image: (h, w), uint8 or uint16.
        target: A single LED; several LEDs cannot be distinguished and are not detected.
        background: The same image with the LED off.

    Raises:
        InputError: if an image is not grey of 8 or 16 bits, or the two differ in shape or type.
    """
    check_image(image)
    if background is not None and (background.shape, background.dtype) != (image.shape, image.dtype):
        raise InputError("the image with the LED off differs in size or bits from the one with the LED on")
    if not target.is_point:
        return None
    full = full_scale(image)
    difference = image if background is None else np.asarray(cv2.subtract(image, background), dtype=image.dtype)
    spots = [_fit_rough_spot(image, background, full, rough) for rough in _bright_spots(difference)]
    distinct: list[Spot] = []  # the brightest first; a spot found twice counts once
    for spot in sorted((spot for spot in spots if spot is not None), key=lambda each: -each.brightness):
        if all(np.hypot(spot.x - other.x, spot.y - other.y) > _LEAST_DISTANCE_PX for other in distinct):
            distinct.append(spot)
    if not distinct:
        return None
    ids = read_only_ids(target.ids) if len(distinct) == 1 else None
    pixels = read_only([(spot.x, spot.y) for spot in distinct])
    return Detection(ids, pixels, read_only([spot.sigma_px for spot in distinct]))


class _RoughSpot(NamedTuple):
    """Position and width of a bright spot [px]."""

    x: float
    y: float
    extent: float


def _bright_spots(levels: Image) -> list[_RoughSpot]:
    """Approximate positions and widths of the brightest spots, from the image at half its size."""
    half = cv2.resize(levels, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    some = half[::_NOISE_STRIDE, ::_NOISE_STRIDE]
    middle = float(np.median(some))
    noise = NORMAL_MAD * float(np.median(np.abs(some - middle)))
    top = float(cv2.minMaxLoc(half)[1])
    threshold = middle + max(_LEAST_HEIGHT_SHARE * (top - middle), _NOISE_SIGMAS * noise, _LEAST_STEP)
    if top <= threshold:
        return []
    outlines, _ = cv2.findContours((half > threshold).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(outline) for outline in outlines]
    small = [box for box in boxes if 2 * max(box[2:]) <= _LARGEST_PX]
    if len(small) > _MOST_CANDIDATES:
        small = sorted(small, key=lambda box: -float(half[box[1] : box[1] + box[3], box[0] : box[0] + box[2]].max()))
    return [
        _RoughSpot(2 * left + width - 0.5, 2 * top + height - 0.5, 2.0 * max(width, height))
        for left, top, width, height in small[:_MOST_CANDIDATES]
    ]


def _fit_rough_spot(image: Image, background: Image | None, full: float, rough: _RoughSpot) -> Spot | None:
    """Fit the spot at a position; None if it is implausible for an LED."""
    reach = int(np.ceil(_REACH_EXTENTS * rough.extent)) + _REACH_MORE_PX
    column, row = round(rough.x), round(rough.y)
    left, top = max(column - reach, 0), max(row - reach, 0)
    window = slice(top, row + reach + 1), slice(left, column + reach + 1)
    levels = image[window].astype(np.float64)
    usable = levels < full
    if background is not None:
        levels -= background[window]
    x, y = rough.x - left, rough.y - top
    spot = fit_spot(levels, usable, (x, y, max(rough.extent / _EXTENT_SIGMAS, _FIRST_WIDTH_PX)))
    if spot is None:
        return None
    near = abs(spot.x - x) < reach / 2 and abs(spot.y - y) < reach / 2
    wide = all(_LEAST_WIDTH_PX < width < _MOST_WIDTH_PX for width in (spot.width_x, spot.width_y))
    if not (near and wide and spot.brightness > 0 and 0 < spot.sigma_px < _MOST_SIGMA_PX):
        return None
    return spot._replace(x=spot.x + left, y=spot.y + top)
