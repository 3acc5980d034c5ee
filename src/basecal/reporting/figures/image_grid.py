"""A grid of squares over an image, with statistics of the points in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from markupsafe import Markup

from basecal.accuracy.residuals.lens_uncertainty import lens_sigmas
from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.errors import count_text
from basecal.fields.digits import two_digits
from basecal.geometry import Array, Camera, IntArray
from basecal.reporting.charts import fitted_scale
from basecal.reporting.contours import contours
from basecal.reporting.svg import Figure, drawing, element, rectangle, tile

IMAGE_WIDTH = 640.0
STRIP = 30.0  # height below an image for its size and the colour bar
_BAR_WIDTH, _BAR_STEPS = 160.0, 8
_COLUMNS = 16  # squares along the longer side: they resolve patterns of a lens and contain points of several views
_LARGEST_ASPECT = 8.0  # of the bounding box of points without an image size
_EXACT_PX = 1e-6  # lower bound of shown values


@dataclass(frozen=True, eq=False)
class ImageGrid:
    """Squares over an image.

    Attributes:
        low: Top left corner [px].
        size: Width and height [px].
        pitch: Size of a square [px].
        shape: Number of columns and rows.
        square: Index of each point's square, row-major, (n,).
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
        """Centres of the squares from the top left corner, row-major, (columns * rows, 2) [px]."""
        columns, rows = (np.arange(count) + 0.5 for count in self.shape)
        return self.pitch * np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)

    @cached_property
    def count(self) -> IntArray:
        """Number of points in each square, (columns * rows,)."""
        return np.bincount(self.square, minlength=self.shape[0] * self.shape[1])

    def means(self, values: Array) -> Array:
        """Means of values, (n,), over the points of each non-empty square, (m,)."""
        some = self.count > 0
        return np.asarray(np.bincount(self.square, values, len(some))[some] / self.count[some])

    def drawing(
        self, title: str, squares: Mapping[int, tuple[float, str]], ends: tuple[str, str], *inside: str
    ) -> Markup:
        """Draw shaded squares of an image with elements on top, and below it the image's size and a colour bar.

        Args:
            title: Title of the drawing.
            squares: Shade, 0 to 1, and text of squares, by index.
            ends: Text for the smallest and for the largest value.
            inside: Elements on top.
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
        texts = (element("text", word, class_="tick", x=x, y=top + 12, text_anchor=at) for word, x, at in words)
        frame = rectangle("frame", (0, 0, width, height))
        return drawing(width, height + STRIP, title, frame, *tiles, *inside, *shades, *texts)


def image_grid(size_px: tuple[int, int] | None, pixels: Array) -> ImageGrid:
    """The grid of an image with points in it, (n, 2) [px]; if its size is unknown, of the points' bounding box."""
    if size_px is not None:
        low, size = np.array([-0.5, -0.5]), np.array(size_px, dtype=np.float64)
    else:
        extent = np.ptp(pixels, axis=0)
        extent = np.maximum(extent, max(float(extent.max()), 1.0) / _LARGEST_ASPECT)
        low, size = pixels.min(0) - 0.05 * extent, 1.1 * extent
    pitch = float(size.max()) / _COLUMNS
    columns, rows = (max(1, round(float(side) / pitch + 0.49)) for side in size)
    cell = np.clip(np.floor((pixels - low) / pitch).astype(np.int64), 0, [columns - 1, rows - 1])
    return ImageGrid(low, size, pitch, (columns, rows), cell[:, 1] * columns + cell[:, 0])


def image_coverage(size_px: tuple[int, int] | None, points: PointResiduals) -> Figure:
    """Squares shaded by the number of points observed in them.

    Args:
        size_px: Size of the camera's images; None for the points' bounding box.
        points: Points of the camera, at least one.
    """
    grid = image_grid(size_px, points.pixels)
    most = int(grid.count.max())
    squares = {
        square: (float(np.sqrt(number / most)), count_text(number, "point"))
        for square, number in enumerate(grid.count.tolist())
        if number
    }
    svg = grid.drawing(f"points in the image of {points.camera}", squares, ("1 point", str(most)))
    share = len(squares) / len(grid.count)
    caption = (
        f"Points were seen in {len(squares)} of {len(grid.count)} squares ({100 * share:.0f} %), "
        f"at most {most} in one. The lens is not checked in the others."
    )
    return Figure(f"{points.camera}, where points were seen", svg, caption)


def lens_uncertainty(name: str, camera: Camera, covariance: Array) -> Figure | None:
    """Squares shaded by 1 sigma of the pixel of a ray, with contours; None if image size or sigmas are unknown."""
    if camera.size_px is None:
        return None
    grid = image_grid(camera.size_px, np.zeros((0, 2)))
    sigmas = lens_sigmas(camera, covariance, grid.low + np.minimum(grid.middles, grid.size - 1))
    known = sigmas[np.isfinite(sigmas)]
    if not len(known):
        return None
    scale = fitted_scale(np.maximum(known, _EXACT_PX).tolist(), 0.0, 1.0)
    squares = {
        k: (scale.position(max(sigma, _EXACT_PX)), f"1 sigma {two_digits(sigma)} px")
        for k, sigma in enumerate(sigmas.tolist())
        if np.isfinite(sigma)
    }
    lines = contours(sigmas.reshape(grid.shape[::-1]), grid.pitch * grid.scale)
    title = f"{name}, uncertainty of the lens"
    ends = two_digits(float(known.min())), f"{two_digits(float(known.max()))} px"
    caption = "1 sigma per axis of the pixel of a ray, without the part that a rotation of the camera absorbs."
    return Figure(title, grid.drawing(title, squares, ends, *lines), caption)
