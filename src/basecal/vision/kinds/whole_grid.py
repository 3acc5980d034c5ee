"""Whether a grid of dark discs is the whole of what is printed, or goes on beyond what was found of it."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array
from basecal.vision.kinds.ways import Grey

_FEWEST_DISCS = 2  # of a row in the image: one dark spot may be anything
_DISC_SHARE = 0.8  # of a row's places with a disc: one may be covered


def has_further_row(image: Grey, grid: Array) -> bool:
    """Whether beyond a side of a grid there is another row of discs.

    Args:
        image: (h, w).
        grid: Centres of discs, (rows, columns, 2) [px], two or more each way.
    """
    gaps = (grid[1:, 1:] + grid[:-1, :-1]) / 2
    middle = (np.median(_levels(image, grid)) + np.median(_levels(image, gaps))) / 2
    return any(
        _has_discs(image, side, middle) for side in (grid, grid[::-1], grid.swapaxes(0, 1), grid.swapaxes(0, 1)[::-1])
    )


def _has_discs(image: Grey, grid: Array, middle: float) -> bool:
    """Whether a row before the first of a grid has discs, and paper between them."""
    before = 2 * grid[0] - grid[1]
    between = (before[1:] + before[:-1]) / 2
    inside = np.all((before >= 0) & (before <= np.array(image.shape[::-1]) - 1), axis=-1)
    if inside.sum() < _FEWEST_DISCS:
        return False
    dark = np.mean(_levels(image, before[inside]) < middle)
    bright = np.mean(_levels(image, between) > middle)
    return bool(dark >= _DISC_SHARE and bright >= _DISC_SHARE)


def _levels(image: Grey, places: Array) -> Array:
    """The level of the nearest pixel, places outside the image at its border."""
    column, row = np.moveaxis(np.rint(places).astype(np.int64), -1, 0)
    height, width = image.shape
    return np.asarray(image[row.clip(0, height - 1), column.clip(0, width - 1)], dtype=np.float64)
