"""How uncertain an estimated lens is over its image, as contours."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.lens_uncertainty import lens_sigmas
from basecal.geometry import Array, Camera
from basecal.reporting.charts import fitted_scale
from basecal.reporting.figures.contours import contours
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import image_grid
from basecal.reporting.statement.digits import two_digits

_EXACT_PX = 1e-6  # shown for less


def lens_uncertainty(name: str, camera: Camera, covariance: Array) -> Figure | None:
    """Squares shaded by 1 sigma of where the lens images a ray, with contours; None if no image size is known."""
    if camera.size_px is None:
        return None
    grid = image_grid(camera.size_px, np.zeros((0, 2)))
    columns, rows = grid.shape
    middles = np.stack(np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5), -1).reshape(-1, 2) * grid.pitch
    sigmas = lens_sigmas(camera, covariance, grid.low + np.minimum(middles, grid.size - 1))
    known = np.flatnonzero(np.isfinite(sigmas))
    if not len(known):
        return None
    low, high = float(sigmas[known].min()), float(sigmas[known].max())
    scale = fitted_scale(np.maximum(sigmas[known], _EXACT_PX).tolist(), 0.0, 1.0)
    tiles = [
        grid.tile(k, scale.position(max(sigma, _EXACT_PX)), f"1 sigma {two_digits(sigma)} px")
        for k, sigma in zip(known.tolist(), sigmas[known].tolist(), strict=True)
    ]
    lines = contours(sigmas.reshape(rows, columns), grid.pitch * grid.scale) if len(known) == len(sigmas) else []
    title = f"{name}, uncertainty of the lens"
    svg = grid.drawing(title, two_digits(low), f"{two_digits(high)} px", *tiles, *lines)
    caption = "1 sigma per axis of where the lens images a ray, without what a rotation of the camera absorbs."
    return Figure(title, svg, caption)
