"""The squares that an image is divided into, and what fell into each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from markupsafe import Markup

from basecal.geometry import Array, IntArray
from basecal.reporting.figures.figure import rectangle, tile
from basecal.reporting.svg import drawing, element

IMAGE_WIDTH = 640.0
STRIP = 30.0  # below an image, for its size and the bar of its shades
_BAR_WIDTH, _BAR_STEPS = 160.0, 8
_COLUMNS = 16  # squares along the longer side: enough to see a lens's pattern, each with points of several views
_LARGEST_ASPECT = 8.0  # of what points without an image cover


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """Squares over an image.

    Attributes:
        low: Its top left corner [px].
        size: Its width and height [px].
        pitch: Size of a square [px].
        shape: Columns and rows.
        square: (n,) which square each point fell into, row by row.
    """

    low: Array
    size: Array
    pitch: float
    shape: tuple[int, int]
    square: IntArray

    @property
    def scale(self) -> float:
        """Scale of the drawing [1 / px]."""
        return IMAGE_WIDTH / float(self.size[0])

    @property
    def middles(self) -> Array:
        """Middles of the squares from the top left corner, row by row, (columns * rows, 2) [px]."""
        columns, rows = (np.arange(count) + 0.5 for count in self.shape)
        return self.pitch * np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)

    @cached_property
    def count(self) -> IntArray:
        """Points in each square, (columns * rows,)."""
        return np.bincount(self.square, minlength=self.shape[0] * self.shape[1])

    def means(self, values: Array) -> Array:
        """Means over the points of each square that has any, (m,) of (n,)."""
        some = self.count > 0
        return np.asarray(np.bincount(self.square, values, len(some))[some] / self.count[some])

    def drawing(
        self, title: str, squares: Mapping[int, tuple[float, str]], ends: tuple[str, str], *inside: str
    ) -> Markup:
        """The image with elements over its shaded squares, and below it its size and a bar of the shades.

        Args:
            title: What it is of.
            squares: Each filled as strongly as its share of the most, with words.
            ends: Words of the least and of the most.
            inside: On top.
        """
        width, height = self.scale * self.size
        corners, pitch = self.scale * (self.middles - 0.5 * self.pitch), self.scale * self.pitch
        tiles = [tile((*corners[k], *np.minimum(pitch, (width, height) - corners[k])), *squares[k]) for k in squares]
        top, right, step = height + 10, width - 140, _BAR_WIDTH / _BAR_STEPS
        shades = (
            tile((right - _BAR_WIDTH + k * step, top, step, 14), k / (_BAR_STEPS - 1), kind="tile shade")
            for k in range(_BAR_STEPS)
        )
        size = f"{self.size[0]:.0f} x {self.size[1]:.0f} px"
        words = ((size, 0, "start"), (ends[0], right - _BAR_WIDTH - 8, "end"), (ends[1], right + 8, "start"))
        said = (element("text", word, class_="tick", x=x, y=top + 12, text_anchor=at) for word, x, at in words)
        frame = rectangle("frame", (0, 0, width, height))
        return drawing(width, height + STRIP, title, frame, *tiles, *inside, *shades, *said)


def image_grid(size_px: tuple[int, int] | None, pixels: Array) -> ImageGrid:
    """The squares of an image with points in it, (n, 2) [px]; where its size is not known, as far as they reach."""
    if size_px is not None:
        low, size = np.array([-0.5, -0.5]), np.array(size_px, dtype=np.float64)
    else:
        extent = np.ptp(pixels, axis=0)
        extent = np.maximum(extent, max(float(extent.max()), 1.0) / _LARGEST_ASPECT)
        low, size = pixels.min(0) - 0.05 * extent, 1.1 * extent
    pitch = float(size.max()) / _COLUMNS
    columns, rows = (max(1, round(float(side) / pitch + 0.49)) for side in size)
    at = np.clip(np.floor((pixels - low) / pitch).astype(np.int64), 0, [columns - 1, rows - 1])
    return ImageGrid(low, size, pitch, (columns, rows), at[:, 1] * columns + at[:, 0])
