"""Refinement of corners to a hundredth of a pixel, with sigmas, by a fit of an ideal corner to the image.

The position of a corner and the directions of its two lines are roughly known. The fit estimates them, the point spread
and the illumination. The residuals give the noise, and so the covariance of the corner. The window is a cross along the
two lines, so that the print in adjacent squares stays outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from basecal.geometry import Array, BoolArray
from basecal.vision.fit.corner_shapes import LEAST_LOG_SPREAD
from basecal.vision.fit.patch_fit import CONVERGED_SIGMAS, Fit, Patches, Shape, fit_shapes, pack_patches

BOARD_ARM_PX = 7.0
"""Arms along lines that extend in both directions. With 12 px, distortion of k1 = -0.35 makes errors exceed sigmas by
25 %."""

_GUARD_SIGMAS = 2.0  # of the point spread: an edge beyond that changes a level by less than a fortieth of its step
_START_SPREAD_PX = 1.0  # [px] initial point spread: a sharp camera has half of it, a soft one twice
_MODEL_ERROR_PX = 0.0015  # rms error of a corner in rendered images without noise
_SHARP_ERROR_PX = 0.075  # rms without noise and blur, lines along pixels; `test_frontal_sharp_target_is_within_sigma`
_SQUARE_VARIANCE = 1 / 12  # of a pixel's square [px^2]
_LEAST_WIDTH_PX = 1.6  # of a band within the guard: it has pixels on both sides of a line of any direction
_MOST_SPREAD_PX = 6.0  # of one corner: a wider spread fills the window
_SPREAD_LIMITS = (LEAST_LOG_SPREAD, -0.5), (np.log(_MOST_SPREAD_PX), 3.0)
_SPREAD_CORNERS = 12  # from which the point spread is estimated, at most: the median of more is hardly better
_MEDIAN_SIGMAS = 1.2533  # sigma of the median of normal numbers over that of their mean
_CERTAIN_SIGMAS = 2.0  # sigmas of zero within which a camera does not sharpen
_SLIGHT_SHARPENING = 0.1  # of sharpening, up to which its effect on the spread is linear
_ROUGH_SHARE = 0.1  # of the residuals' norm: a hundredth of the cost of some hundred pixels is one sigma of the corner
_THINNING = 5  # one of five pixels is used for the rough fit, in a pattern of knight's moves
_LEAST_THINNED_PIXELS = 40  # of a thinned patch: with fewer, all pixels are used
_LEAST_CONTRAST = 2.0  # step of a line in sigmas of a pixel's noise: no detector finds a corner with less
_DIAGONAL_FACTOR = 1.4  # reach of a rotated cross over its arm
_LEAST_FREEDOMS = 8  # degrees of freedom of the residuals, which determine the noise to 25 %
_MOST_SIGMA_PX = 1.0  # of a position, above which it is rejected
_MOST_MOVED_PX = 3.0  # from the initial position, beyond which it is another corner


Levels = NDArray[Any]
"""An image, or levels computed from one, (h, w)."""


@dataclass(frozen=True)
class Window:
    """The cross around a corner in which the image follows the ideal corner, in units of the pitch along each axis.

    Attributes:
        arm_px: Largest distance along the lines [px], so that distortion bends them negligibly.
        arm: Largest distance along the lines.
        inside: Largest distance from the nearer line, at points with two positive coordinates.
        outside: Largest distance from the nearer line, at other points.
        before: Largest distance towards negative coordinates.
    """

    arm_px: float
    arm: float
    inside: float
    outside: float
    before: float


@dataclass(frozen=True, eq=False)
class Corners:
    """Refined corners: `pixels` (n, 2), `sigma_px` (n,) per coordinate, `trusted` (n,) and `gain` (n,) [levels]."""

    pixels: Array
    sigma_px: Array
    trusted: BoolArray
    gain: Array


def refine_corners(image: Levels, shape: Shape, start: Array, axes: Array, window: Window) -> Corners:
    """Refine corners near `start`.

    Args:
        image: (h, w) grey levels.
        shape: `saddle` or `wedge`.
        start: Initial positions, (n, 2) [px].
        axes: Image of a pitch along the corner's first and second line, (n, 2, 2) [px], a row for each line.
        window: The area in which the image follows the ideal corner.
    """
    if not len(start):
        return Corners(start, np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0))
    context, q = _Context(image, shape, axes, window), _parameters(start, axes)
    q[:, 4:] = _estimate_blur(image, shape, start, axes, window)
    rough = _fit_corners(context, q, held_count=1, tolerance=_ROUGH_SHARE)
    # Repeat the fit in windows around the refined corners.
    q[:, :4] = np.where(_accepted_fits(rough, start)[:, None], rough.shape[:, :4], q[:, :4])
    fit = _fit_corners(context, q, held_count=1)
    model = _MODEL_ERROR_PX**2 + _pixel_error_px(fit.shape) ** 2
    sigma = np.sqrt(np.trace(fit.covariance[:, :2, :2], axis1=1, axis2=2) / 2 + model)
    return Corners(fit.shape[:, :2], sigma, _accepted_fits(fit, start) & (sigma < _MOST_SIGMA_PX), fit.light[:, 0])


def _pixel_error_px(shape: Array) -> Array:
    """Errors, (n,) [px], of corners with parameters, (n, 6), because the model assumes Gaussian pixels, not squares.

    The error is periodic in pixels: it decreases with the point spread like the first harmonic of a sampled Gaussian.
    Along a line that crosses rows or columns, its signs alternate.
    """
    spread = np.exp(np.minimum(shape[:, 4], np.log(_MOST_SPREAD_PX)))
    blur = np.maximum(spread**2 - _SQUARE_VARIANCE, 0.0)
    slope = np.abs(np.tan((shape[:, 2:4] + np.pi / 4) % (np.pi / 2) - np.pi / 4))  # to the nearest row or column
    crossed = 2 * BOARD_ARM_PX * slope
    of_lines = _SHARP_ERROR_PX / (1 + np.pi * crossed)
    return np.asarray(np.sqrt(np.mean(of_lines**2, axis=1)) * np.exp(-2 * np.pi**2 * blur))


def _estimate_blur(image: Levels, shape: Shape, start: Array, axes: Array, window: Window) -> Array:
    """Median log spread and sharpening of some corners, (2,); a single corner hardly separates the two."""
    some = slice(None, None, max(1, len(start) // _SPREAD_CORNERS))
    start, axes = start[some], axes[some]
    rough = _fit_corners(
        _Context(image, shape, axes, window), _parameters(start, axes), held_count=1, tolerance=_ROUGH_SHARE
    )
    sound = _accepted_fits(rough, start)
    if not sound.any():
        return np.array([np.log(_START_SPREAD_PX), 0.0])
    free = _fit_corners(_Context(image, shape, axes[sound], window), rough.shape[sound], held_count=0)
    spread, share = free.shape[:, 4:].T
    variance = free.covariance[:, 5, 5]
    doubt = _MEDIAN_SIGMAS * np.sqrt(np.median(variance) / len(share))
    if abs(np.median(share)) < min(_CERTAIN_SIGMAS * doubt, _SLIGHT_SHARPENING):
        # Without sharpening, which halves the work: condition the spread on zero sharpening.
        spread, share = spread - free.covariance[:, 4, 5] / variance * share, np.zeros(len(share))
    return np.asarray(np.median(np.column_stack([spread, share]), axis=0).clip(*_SPREAD_LIMITS))


def _parameters(start: Array, axes: Array) -> Array:
    along, across = axes[:, 0], -axes[:, 1]
    angles = [np.arctan2(line[:, 1], line[:, 0]) for line in (along, across)]
    lens = np.broadcast_to([np.log(_START_SPREAD_PX), 0.0], (len(start), 2))
    return np.column_stack([start, *angles, lens])


@dataclass(frozen=True, eq=False)
class _Context:
    """Arguments that all rounds of refinement share; see `refine_corners`."""

    image: Levels
    shape: Shape
    axes: Array
    window: Window


def _fit_corners(context: _Context, q: Array, held_count: int, tolerance: float = CONVERGED_SIGMAS) -> Fit:
    """Fit corners, with covariance from the noise of the residuals; a rough fit uses a fifth of the pixels."""
    middle = np.rint(q[:, :2])
    used = _cross_patches(context, q, middle, _THINNING if tolerance == _ROUGH_SHARE else 1)
    fit = fit_shapes(
        context.shape,
        np.column_stack([q[:, :2] - middle, q[:, 2:]]),
        used,
        has_slope=True,
        held_count=held_count,
        tolerance=tolerance,
    )
    weights = used.weights
    freedom = np.maximum((weights > 0).sum(axis=1) - q.shape[1] - fit.light.shape[1], 1)
    noise = (weights * fit.residuals**2).sum(axis=1) / freedom
    shape = np.column_stack([fit.shape[:, :2] + middle, fit.shape[:, 2:]])
    covariance = fit.covariance * noise[:, None, None]
    has_contrast = np.abs(fit.light[:, 0]) > _LEAST_CONTRAST * np.sqrt(noise)
    converged = fit.converged & has_contrast & (freedom > _LEAST_FREEDOMS)
    return Fit(shape, fit.light, covariance, fit.residuals, converged)


def _cross_patches(context: _Context, q: Array, middle: Array, thinning: int) -> Patches:
    """Pixels in the crosses of corners, relative to `middle`; thinned if enough remain."""
    patches = cut_patches(context.image, middle, int(np.ceil(_DIAGONAL_FACTOR * context.window.arm_px)), thinning)
    weights = patches.weights * _cross_mask(context, q, q[:, :2] - middle, patches.xy)
    used = pack_patches(patches, weights)
    few = thinning > 1 and (used.weights > 0).sum(axis=1).min() < _LEAST_THINNED_PIXELS
    return _cross_patches(context, q, middle, 1) if few else used


def _cross_mask(context: _Context, q: Array, corners: Array, xy: Array) -> BoolArray:
    """Mask of positions, `xy`, (n, p, 2), in the crosses of corners at `corners`, (n, 2)."""
    offset = xy - corners[:, None]
    to_pitches = np.linalg.inv(context.axes)[:, None]
    pitches = [offset[..., 0] * to_pitches[..., 0, k] + offset[..., 1] * to_pitches[..., 1, k] for k in range(2)]
    length = np.linalg.norm(context.axes, axis=2)
    height = np.abs(np.linalg.det(context.axes))[:, None] / length[:, ::-1]  # [px] from the other line, per pitch
    guard = _GUARD_SIGMAS * np.exp(q[:, 4])[:, None] / height
    least = _LEAST_WIDTH_PX / height
    inside, outside = (np.maximum(limit - guard, least) for limit in (context.window.inside, context.window.outside))
    before = -np.maximum(context.window.before - guard, least)
    arm = np.minimum(context.window.arm, context.window.arm_px / length)
    both_positive = (pitches[0] > 0) & (pitches[1] > 0)
    near, within = np.zeros_like(both_positive), np.ones_like(both_positive)
    for k, coordinate in enumerate(pitches):
        size = np.abs(coordinate)
        near |= size < np.where(both_positive, inside[:, k, None], outside[:, k, None])
        within &= (size < arm[:, k, None]) & (coordinate > before[:, k, None])
    return np.asarray(near & within)


def cut_patches(image: Levels, middle: Array, reach: int, thinning: int = 1) -> Patches:
    """Cut square patches around whole pixels, (n, 2), as origin; pixels outside the image have weight 0.

    A thinned patch keeps one of `thinning` pixels; the pattern shifts by two columns in each row.
    """
    height, width = image.shape
    steps = np.arange(-reach, reach + 1)
    xy = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    xy = xy[(xy[:, 0] + 2 * xy[:, 1]) % thinning == 0]
    column, row = np.moveaxis(middle.astype(np.int64)[:, None] + xy, -1, 0)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    values = image[row.clip(0, height - 1), column.clip(0, width - 1)].astype(np.float64)
    positions = np.broadcast_to(xy.astype(np.float64), (*column.shape, 2)).copy()
    return Patches(positions, values, inside.astype(np.float64))


def _accepted_fits(fit: Fit, start: Array) -> BoolArray:
    log_spread = fit.shape[:, 4]
    moved = np.linalg.norm(fit.shape[:, :2] - start, axis=1)
    sound: BoolArray = fit.converged & (moved < _MOST_MOVED_PX) & (log_spread < np.log(_MOST_SPREAD_PX))
    return sound
