"""Local maps from a plane to an image around given points, from points known in both."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array

_REACH_PITCHES = 1.3  # pitches: the weight hardly extends beyond the eight neighbours of a disc
_FAR_WEIGHT = 1e-4  # weight of distant points: determines a map with too few close points
_RIDGE = 1e-9  # in squared pitches of one point: only collinear points need it
_CUBIC_RIDGE = 1e-6  # in squared pitches of one point: a grid of two rows has no second derivative across them


def local_axes(points: Array, plane: Array, pixels: Array, pitch: float) -> Array:
    """Images of a pitch along x and along y of a plane, at given points of the plane.

    Args:
        points: Points of the plane, (n, 2) [m].
        plane: Known points, (m, 2) [m], three or more and not collinear.
        pixels: Images of the known points, (m, 2) [px].
        pitch: Length [m], also the scale of the weight exp(-(distance / pitch)^2 / 2) of known points.

    Returns:
        (n, 2, 2) [px], a row for each axis.
    """
    offset = (plane[None] - points[:, None]) / pitch
    weight = np.exp(-0.5 * (offset**2).sum(axis=2)) + _FAR_WEIGHT
    basis = np.concatenate([offset, np.ones((*offset.shape[:2], 1))], axis=2)
    weighted = np.swapaxes(basis * weight[..., None], 1, 2)
    normal = weighted @ basis + _RIDGE * np.eye(3)
    return np.asarray(np.linalg.solve(normal, weighted @ pixels)[:, :2])


def local_homographies(plane: Array, pixels: Array, pitch: float) -> tuple[Array, Array]:
    """Local homographies of a plane around each of its points, and the second derivatives of their residuals.

    Args:
        plane: Points, (n, 2) [m], four or more and no three collinear.
        pixels: Images of the points, (n, 2) [px].
        pitch: Length [m]; points have weights exp(-(distance / pitch / 1.3)^2 / 2).

    Returns:
        Homographies from offsets in pitches to pixels, (n, 3, 3), the last element 1.
        Second derivatives xx, xy, yy of the residuals, (n, 3, 2) [px per pitch^2].

    Source: Hartley & Zisserman 2004, section 4.1.
    """
    offset = (plane[None] - plane[:, None]) / pitch
    weight = np.exp(-0.5 * (offset**2).sum(axis=2) / _REACH_PITCHES**2) + _FAR_WEIGHT
    x, y = np.moveaxis(offset, 2, 0)
    scale = np.ptp(pixels, axis=0).max()
    u, v = np.moveaxis((pixels[None] - pixels[:, None]) / scale, 2, 0)
    one, zero = np.ones_like(x), np.zeros_like(x)
    for_u = np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=2) * weight[..., None]
    for_v = np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=2) * weight[..., None]
    rows = np.concatenate([for_u, for_v], axis=1)
    _, vectors = np.linalg.eigh(np.swapaxes(rows, 1, 2) @ rows)
    matrix = vectors[:, :, 0].reshape(-1, 3, 3)
    matrix = matrix / matrix[:, 2:, 2:]
    matrix[:, :2] *= scale
    matrix[:, :2] += pixels[:, :, None] * matrix[:, 2:]
    mapped = np.stack([x, y, one], axis=2) @ np.swapaxes(matrix, 1, 2)
    left_over = pixels[None] - mapped[..., :2] / mapped[..., 2:]
    return matrix, _second_derivatives(offset, weight, left_over)


def _second_derivatives(offset: Array, weight: Array, values: Array) -> Array:
    """Second derivatives xx, xy and yy, (n, 3, 2), of a cubic fitted to values, (n, m, 2), at offsets, (n, m, 2)."""
    x, y = np.moveaxis(offset, 2, 0)
    basis = np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2, x**3, x * x * y, x * y * y, y**3], axis=2)
    weighted = np.swapaxes(basis * weight[..., None] ** 2, 1, 2)
    normal = weighted @ basis + _CUBIC_RIDGE * np.eye(10)
    return np.asarray(np.linalg.solve(normal, weighted @ values)[:, 3:6])


def grid_axes(grid: Array) -> Array:
    """Steps in the image to the next column and to the next row, at each point of a grid.

    Args:
        grid: (rows, columns, 2) [px], at least two rows and two columns.

    Returns:
        (rows * columns, 2, 2) [px], a row for each axis.
    """
    along, down = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    return np.stack([along, down], axis=2).reshape(-1, 2, 2)


def orient_grid(grid: Array) -> Array:
    """Order the rows of a grid in the image as for a print viewed from its front, (rows, columns, 2)."""
    along, down = np.moveaxis(grid_axes(grid), 1, 0)
    turn = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0]
    return grid if np.median(turn) > 0 else grid[::-1]
