"""How uncertain an estimated lens is over its image, as contours."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.lens_uncertainty import lens_sigmas
from basecal.geometry import Array, Camera
from basecal.reporting.charts import fitted_scale
from basecal.reporting.contours import contours
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.image_grid import image_grid
from basecal.reporting.statement.digits import two_digits

_EXACT_PX = 1e-6  # shown for less


def lens_uncertainty(name: str, camera: Camera, covariance: Array) -> Figure | None:
    """Squares shaded by 1 sigma of where the lens images a ray, with contours; None if no image size is known."""
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
    caption = "1 sigma per axis of where the lens images a ray, without what a rotation of the camera absorbs."
    return Figure(title, grid.drawing(title, squares, ends, *lines), caption)
