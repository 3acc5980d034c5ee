"""Motion between two images, which shows whether a camera and its scene are at rest.

The image is divided into blocks. In each block the shift along the strongest gradient is estimated by least squares on
the brightness. Source: Lucas & Kanade 1981.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array
from basecal.numerics.robust_step import NORMAL_MAD
from basecal.vision.detection import Image

Levels = NDArray[np.float32]
_LEAST_SQUARED_SLOPE = 1e-9  # lower bound of squared gradients, against division by zero

_REDUCTION = 2  # factor by which images are reduced: less work at nearly the same accuracy
_BLOCK_PX = 40  # side of a block in reduced pixels: some squares of a board, or an LED with its surroundings
_CERTAIN_PX = 0.05  # largest sigma of a block's shift: blocks with less structure are ignored
_SMOOTH_PX = 0.8  # sigma of the smoothing in reduced pixels, so that noise makes no edges
_NOISE_STRIDE = 7  # rows and columns between the pixels that determine the noise
_NOISE_SIGMAS = 4.5  # sigmas: exceeded by chance by any of a hundred blocks in one of a thousand images


def reduce_image(image: Image) -> Levels:
    """Reduce and smooth an image for `shift_between`."""
    size = (image.shape[1] // _REDUCTION, image.shape[0] // _REDUCTION)
    reduced = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(reduced, (0, 0), _SMOOTH_PX), dtype=np.float32)


def shift_between(first: Levels, second: Levels) -> float:
    """Largest shift of any block between two images beyond the noise [px].

    The shift is 0 if no block has structure, and infinite if the images differ in size.

    Args:
        first: The first image, from `reduce_image`.
        second: The second image, from `reduce_image`.
    """
    if first.shape != second.shape:
        return np.inf
    middle, change = cv2.addWeighted(first, 0.5, second, 0.5, 0.0), second - first
    along_u, along_v = (cv2.Sobel(middle, cv2.CV_32F, *which, ksize=1, scale=0.5) for which in ((1, 0), (0, 1)))
    uu, uv, vv = (_block_sums(each) for each in (along_u * along_u, along_u * along_v, along_v * along_v))
    downhill = np.stack([_block_sums(along_u * change), _block_sums(along_v * change)], -1)
    strongest = np.maximum(0.5 * (uu + vv + np.hypot(uu - vv, 2 * uv)), _LEAST_SQUARED_SLOPE)
    along = 0.5 * np.arctan2(2 * uv, uu - vv)
    axis = np.stack([np.cos(along), np.sin(along)], -1)
    # Smoothing correlates the noise of neighbours: this number of pixels counts as one.
    correlated_count = 1.0 + 4 * np.pi * _SMOOTH_PX**2
    noise = NORMAL_MAD * float(np.median(np.abs(change[::_NOISE_STRIDE, ::_NOISE_STRIDE]))) * np.sqrt(correlated_count)
    sigma = noise / np.sqrt(strongest)
    shift = np.abs((downhill * axis).sum(-1)) / strongest
    beyond = np.where(_REDUCTION * sigma < _CERTAIN_PX, shift - _NOISE_SIGMAS * sigma, 0.0)
    return _REDUCTION * float(max(beyond.max(initial=0.0), 0.0))


def _block_sums(levels: Levels) -> Array:
    """Sums over blocks; remaining pixels at the borders are ignored."""
    rows, columns = (max(1, side // _BLOCK_PX) for side in levels.shape)
    height, width = (side // count for side, count in zip(levels.shape, (rows, columns), strict=True))
    inside = levels[: rows * height, : columns * width]
    return np.asarray(inside.reshape(rows, height, columns, width).sum((1, 3)), dtype=np.float64)
