"""The squares that an image is divided into, and what fell into each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.geometry import Array, IntArray
from basecal.reporting.figures.figure import rectangle, tile
from basecal.reporting.svg import drawing, element, text

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
    def height(self) -> float:
        """Height of the drawing."""
        return float(self.size[1]) * self.scale

    def sums(self, values: Array) -> Array:
        """Sums over the points of each square, (columns * rows,) of (n,)."""
        columns, rows = self.shape
        summed: Array = np.bincount(self.square, values, columns * rows).astype(np.float64)
        return summed

    def tile(self, square: int, share: float, label: str) -> str:
        """A square filled as strongly as its share of the most, which says what it is."""
        left, top = np.array([square % self.shape[0], square // self.shape[0]]) * self.pitch * self.scale
        width, height = np.minimum(self.pitch * self.scale, np.array([IMAGE_WIDTH - left, self.height - top]))
        return tile((left, top, width, height), share, label)

    def drawing(self, title: str, low_label: str, high_label: str, *inside: str) -> str:
        """The image with elements over its frame, and below it the bar of their shades."""
        frame = rectangle("frame", (0, 0, IMAGE_WIDTH, self.height))
        return drawing(IMAGE_WIDTH, self.height + STRIP, title, frame, *inside, *self.strip(low_label, high_label))

    def strip(self, low_label: str, high_label: str) -> list[str]:
        """Below the image: its size, and a bar from the shade of the least to that of the most."""
        top, right = self.height + 10, IMAGE_WIDTH - 124
        step = _BAR_WIDTH / _BAR_STEPS
        starts = right - _BAR_WIDTH + step * np.arange(_BAR_STEPS)
        bars = [tile((x, top, step, 14), k / (_BAR_STEPS - 1), kind="tile shade") for k, x in enumerate(starts)]
        word = {"class_": "tick", "y": f"{top + 12:.1f}"}
        width, height = (f"{side:.0f}" for side in self.size)
        return [
            element("text", text(f"{width} x {height} px"), x=0, **word),
            *bars,
            element("text", text(low_label), x=f"{right - _BAR_WIDTH - 8:.1f}", text_anchor="end", **word),
            element("text", text(high_label), x=f"{right + 8:.1f}", **word),
        ]


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
