"""How a plane lies in an image around each of some points, from other points known in both."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array

_REACH_PITCHES = 1.3  # pitches: eight neighbours on every side of a disc count, and hardly any more
_FAR_WEIGHT = 1e-4  # weight of points far away: keeps a map defined where too few are near
_RIDGE = 1e-9  # in squared pitches of one point: only points in a line need it
_CUBIC_RIDGE = 1e-6  # likewise: a grid of two rows has no second derivative across them


def local_axes(place: Array, plane: Array, pixels: Array, pitch: float) -> Array:
    """Images of a pitch along x and along y of the plane, near places of the plane.

    Args:
        place: Where, (n, 2) [m].
        plane: Known points, (m, 2) [m], three or more and not in a line.
        pixels: The same in the image, (m, 2) [px].
        pitch: Length [m], also how far points count: with exp(-(distance / pitch)^2 / 2).

    Returns:
        (n, 2, 2) [px], a row for each axis.
    """
    offset = (plane[None] - place[:, None]) / pitch
    weight = np.exp(-0.5 * (offset**2).sum(axis=2)) + _FAR_WEIGHT
    basis = np.concatenate([offset, np.ones((*offset.shape[:2], 1))], axis=2)
    weighted = np.swapaxes(basis * weight[..., None], 1, 2)
    normal = weighted @ basis + _RIDGE * np.eye(3)
    return np.asarray(np.linalg.solve(normal, weighted @ pixels)[:, :2])


def local_homographies(plane: Array, pixels: Array, pitch: float) -> tuple[Array, Array]:
    """How the plane lies in perspective around each of its points, and how it is bent beyond that.

    Args:
        plane: Points, (n, 2) [m], four or more and no three in a line.
        pixels: The same in the image, (n, 2) [px].
        pitch: Length [m]; points count with exp(-(distance / pitch / 1.3)^2 / 2).

    Returns:
        From pitches away from the point to pixels, (n, 3, 3), the last element 1.
        Second derivatives xx, xy, yy of what perspective leaves over, (n, 3, 2) [px per pitch^2].

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
    """Images of a step along columns and along rows, at each point of a grid.

    Args:
        grid: (rows, columns, 2) [px], two or more of each.

    Returns:
        (rows * columns, 2, 2) [px], a row for each axis.
    """
    along, down = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    return np.stack([along, down], axis=2).reshape(-1, 2, 2)


def orient_grid(grid: Array) -> Array:
    """A grid in the image with its rows in the order in which a print is seen from its front, (rows, columns, 2)."""
    along, down = np.moveaxis(grid_axes(grid), 1, 0)
    turn = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0]
    return grid if np.median(turn) > 0 else grid[::-1]
