"""Grids of circles: OpenCV finds the grid, an ellipse is then fitted to each disc's edge.

The centre of a disc is not imaged at the centre of its ellipse. The difference follows from the local homography of the
grid, and is subtracted. Source: Heikkila 2000, doi:10.1109/34.879788. As with a chessboard, ids may count from either
end if the grid is symmetric under half a turn.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.geometry import Array, BoolArray
from basecal.vision.detection import Detection, Image, eight_bit, make_detection
from basecal.vision.fit.corners import cut_patches
from basecal.vision.fit.ellipse import ellipse
from basecal.vision.fit.local_map import local_axes, local_homographies
from basecal.vision.fit.patch_fit import Patches, fit_shapes, pack_patches
from basecal.vision.kinds.preprocessing import Grey, Preprocessing, best_result

_MODEL_ERROR_PX = 0.0007  # of a centre in rendered images without noise and distortion
_DISTORTION_SHARE = 0.05  # uncertain share of the correction for distortion
_LEAST_REACH_PX, _MOST_REACH_PX = 4, 40  # half side of a window: enough for an outline, bounded for run time
_MOST_MOVED_PX = 3.0  # from OpenCV's centre, beyond which it is not the disc
# For typical images, dark or noisy ones, blurred ones, and small targets.
_PREPROCESSINGS = (
    Preprocessing(),
    Preprocessing(0.5, stretched=True),
    Preprocessing(stretched=True, sharpened=True),
    Preprocessing(2.0, stretched=True),
)
_MOST_BLOBS = 10  # per circle: with more OpenCV needs minutes and finds no grid
_FEWEST_DISCS = 4  # that determine a homography
_LEAST_AREA_PX2 = 12.0  # of a disc, four pixels wide: smaller ones have no outline to fit
_LARGEST_SHARE = 0.05  # of the image, for a disc of a grid of at least four
_LEAST_DISTANCE_PX = 3.0  # between centres of discs: less than the distance of any two such discs
_LEAST_CONTRAST = 3.0  # of a disc to the paper, in sigmas of a pixel's noise
# Residual beyond noise, as a share of the print's contrast: 0.02 for discs, 0.15 and more for squares.
_MOST_SHARED_RESIDUAL = 0.1
_DARK_BRIGHT_PERCENT = (3, 97)  # levels of print and paper in a window, excluding one or two outlying pixels
_RESIDUAL_DECIMALS = 6  # [px] of equal residuals of an order and its reverse
_FEWEST_WHOLE_DISCS = 2  # of a row inside the image: a single dark spot is no evidence
_DISC_SHARE = 0.8  # share of a row's positions with a disc: one may be covered


def detect(image: Image, target: Target) -> Detection | None:
    """Detect the centres of a grid of dark or bright circles, row-major; None if it is not entirely visible.

    Args:
        image: (h, w), uint8 or uint16.
        target: The grid.

    Raises:
        InputError: if the image is not grey of 8 or 16 bits.
    """
    return _detect_dark(image, target) or _detect_dark(_invert(image), target)


def _detect_dark(image: Image, target: Target) -> Detection | None:
    centres = best_result(eight_bit(image), _PREPROCESSINGS, partial(_centres, target), len(target.ids))
    if centres is None:
        return None
    plane, spacing = target.points[:, :2], float(target.options["spacing_m"])
    ordered = _order_centres(target, centres)
    if ordered is None:
        return None
    outlines = _fit_outlines(image, target, ordered)
    kept, shape = outlines.trusted, outlines.shape[outlines.trusted]
    if kept.sum() < _FEWEST_DISCS or np.median(outlines.shared_residual) > _MOST_SHARED_RESIDUAL:
        return None
    perspective, distortion = _eccentricity(plane[kept], shape, spacing)
    model = _MODEL_ERROR_PX**2 + (_DISTORTION_SHARE * np.linalg.norm(distortion, axis=1)) ** 2
    centres = shape[:, :2] - perspective - distortion
    return make_detection(target.ids[kept], centres, np.sqrt(outlines.variance[kept] + model))


def has_grid(image: Grey, target: Target) -> bool:
    """Whether OpenCV finds the grid in an image, (h, w), without changes of scale or levels."""
    return any(len(_centres(target, levels, Preprocessing())) > 0 for levels in (image, eight_bit(_invert(image))))


def _invert(image: Image) -> Image:
    """Invert an image, so that bright discs become dark."""
    return np.asarray(cv2.bitwise_not(image))


def _centres(target: Target, image: Grey, preprocessing: Preprocessing) -> Array:
    """OpenCV's centres of all circles, (n, 2) [px]; empty if it does not find the grid."""
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if target.options["asymmetric"] else cv2.CALIB_CB_SYMMETRIC_GRID
    parameters = cv2.SimpleBlobDetector.Params()  # discs of any size that a grid can have in the image
    parameters.minArea, parameters.maxArea = _LEAST_AREA_PX2, max(image.size * _LARGEST_SHARE, _LEAST_AREA_PX2)
    parameters.minDistBetweenBlobs = _LEAST_DISTANCE_PX
    finder = cv2.SimpleBlobDetector.create(parameters)
    if len(finder.detect(image)) > _MOST_BLOBS * len(target.ids):
        return preprocessing.original_pixels(())
    is_found, centres = cv2.findCirclesGrid(image, tuple(target.options["circles"]), flags=kind, blobDetector=finder)
    # OpenCV also finds a part of a larger symmetric grid, a different one in every image.
    columns, rows = target.options["circles"]
    grid = np.reshape(centres, (rows, columns, 2)) if is_found else np.zeros((0, 0, 2))
    is_part = is_found and not target.options["asymmetric"] and has_further_row(image, grid.astype(np.float64))
    return preprocessing.original_pixels(centres if is_found and not is_part else ())


def _order_centres(target: Target, centres: Array) -> Array | None:
    """Order OpenCV's centres, (n, 2) [px], as in a print viewed from its front; None if they are a mirror image.

    OpenCV may return the rows in reverse order. In an asymmetric grid with an even number of rows, it may exchange each
    row with the next. The order that fits a linear map of the print best is taken.
    """
    columns, rows = target.options["circles"]
    grid = centres.reshape(rows, columns, 2)
    orders = [grid, grid[::-1]]
    if target.options["asymmetric"] and rows % 2 == 0:
        exchanged = grid.reshape(-1, 2, columns, 2)[:, ::-1].reshape(grid.shape)
        orders += [exchanged, exchanged[::-1]]
    plane = target.points[:, :2] - target.points[:, :2].mean(0)
    pixels = np.stack(orders).reshape(len(orders), -1, 2)
    maps = np.linalg.pinv(plane) @ pixels
    residuals = np.linalg.norm(pixels - pixels.mean(1, keepdims=True) - plane @ maps, axis=(1, 2))
    mirrored = np.linalg.det(maps) <= 0
    best = np.lexsort((mirrored, np.round(residuals, _RESIDUAL_DECIMALS)))[0]  # the front first of equal fits
    return None if mirrored[best] else np.asarray(pixels[best])


class _Outlines(NamedTuple):
    """Fitted ellipses, (n, 6) parameters of `ellipse`, the variance of their centres (n,), and whether to trust each.

    `shared_residual`, (n,), is the residual beyond noise over the contrast.
    """

    shape: Array
    variance: Array
    trusted: BoolArray
    shared_residual: Array


def _fit_outlines(image: Image, target: Target, start: Array) -> _Outlines:
    plane = target.points[:, :2]
    axes = local_axes(plane, plane, start, float(target.options["spacing_m"]))
    middle, used = _windows(image, start, axes, target)
    # Initial outlines as parameters of `ellipse`, (n, 3): shapes from the grid's axes, sizes from the dark areas.
    levels = np.where(used.weights > 0, used.values, np.nan)
    low, high = np.nanpercentile(levels, _DARK_BRIGHT_PERCENT, axis=1)
    dark = np.maximum((levels < ((low + high) / 2)[:, None]).sum(axis=1), 1)
    radius = np.sqrt(dark / np.pi / np.abs(np.linalg.det(axes)))
    squared = np.swapaxes(axes, 1, 2) @ axes * (radius**2)[:, None, None]
    values, vectors = np.linalg.eigh(squared)
    half_log = (vectors * (0.5 * np.log(values))[:, None]) @ np.swapaxes(vectors, 1, 2)
    outline = half_log[:, [0, 0, 1], [0, 1, 1]]
    fit = fit_shapes(ellipse, np.column_stack([start - middle, outline, np.zeros(len(start))]), used)
    freedom = np.maximum((used.weights > 0).sum(axis=1) - fit.shape.shape[1] - 2, 1)
    noise = (used.weights * fit.residuals**2).sum(axis=1) / freedom
    variance = noise * np.trace(fit.covariance[:, :2, :2], axis1=1, axis2=2) / 2
    shape = np.column_stack([fit.shape[:, :2] + middle, fit.shape[:, 2:]])
    near = np.linalg.norm(shape[:, :2] - start, axis=1) < _MOST_MOVED_PX
    contrast = np.abs(fit.light[:, 0])
    trusted = fit.converged & near & (contrast > _LEAST_CONTRAST * np.sqrt(noise))
    return _Outlines(shape, variance, trusted, _shared_residual(used, fit.residuals) / np.maximum(contrast, 1e-9))


def _shared_residual(patches: Patches, residuals: Array) -> Array:
    """Root mean square, (n,), of the part of residuals, (n, p), that is equal in neighbours, which noise is not."""
    weights = patches.weights > 0
    pairs = weights[:, 1:] & weights[:, :-1]
    products = np.where(pairs, residuals[:, 1:] * residuals[:, :-1], 0.0)
    return np.asarray(np.sqrt(np.maximum(products.sum(axis=1) / np.maximum(pairs.sum(axis=1), 1), 0.0)))


def _windows(image: Image, start: Array, axes: Array, target: Target) -> tuple[Array, Patches]:
    """Whole pixels, (n, 2), and patches around them, up to half the distance to the next disc."""
    room = 0.5 * (np.sqrt(2) if target.options["asymmetric"] else 1.0)
    reach = int(np.clip(np.ceil(room * np.linalg.norm(axes, axis=2).max()), _LEAST_REACH_PX, _MOST_REACH_PX))
    middle = np.rint(start)
    patches = cut_patches(image, middle, reach)
    pitches = (patches.xy - (start - middle)[:, None]) @ np.linalg.inv(axes)
    own = np.linalg.norm(pitches, axis=2) < room
    return middle, pack_patches(patches, patches.weights * own)


def _eccentricity(plane: Array, shape: Array, spacing: float) -> tuple[Array, Array]:
    """Offsets of the ellipses' centres from the images of the discs' centres, (n, 2) [px], in two parts.

    The first part is due to perspective. In the axes of the grid around each disc, a circle of radius r has the dual
    conic diag(r^2, r^2, -1). The second part is due to distortion by the lens.
    """
    pixels_from_plane, second_derivatives = local_homographies(plane, shape[:, :2], spacing)
    jacobian = pixels_from_plane[:, :2, :2] - pixels_from_plane[:, :2, 2:] * pixels_from_plane[:, 2:, :2]
    area = np.exp(shape[:, 2] + shape[:, 4])  # the determinant of an exponential
    squared = area / np.abs(np.linalg.det(jacobian))
    circle = np.stack([squared, squared, -np.ones_like(squared)], axis=1)[:, :, None] * np.eye(3)
    conic = pixels_from_plane @ circle @ np.swapaxes(pixels_from_plane, 1, 2)
    perspective = conic[:, :2, 2] / conic[:, 2:, 2] - pixels_from_plane[:, :2, 2]
    # Per squared radius, a bend along x shifts by (3 xx + yy) / 8 along x and xy / 4 along y; y with x, y exchanged.
    xx, xy, yy = np.moveaxis(second_derivatives @ np.swapaxes(np.linalg.inv(jacobian), 1, 2), 1, 0)
    x = (3 * xx[:, 0] + yy[:, 0]) / 8 + xy[:, 1] / 4
    y = (3 * yy[:, 1] + xx[:, 1]) / 8 + xy[:, 0] / 4
    distortion: Array = (jacobian @ np.stack([x, y], axis=1)[..., None])[..., 0] * squared[:, None]
    return perspective, distortion


def has_further_row(image: Grey, grid: Array) -> bool:
    """Whether there is another row of discs beyond a side of a grid.

    Args:
        image: (h, w).
        grid: Centres of discs, (rows, columns, 2) [px], at least two rows and two columns.
    """
    gaps = (grid[1:, 1:] + grid[:-1, :-1]) / 2
    middle = (np.median(_levels(image, grid)) + np.median(_levels(image, gaps))) / 2
    return any(
        _has_discs(image, side, middle) for side in (grid, grid[::-1], grid.swapaxes(0, 1), grid.swapaxes(0, 1)[::-1])
    )


def _has_discs(image: Grey, grid: Array, middle: float) -> bool:
    """Whether there are discs with paper between them in a row before the first of a grid."""
    before = 2 * grid[0] - grid[1]
    between = (before[1:] + before[:-1]) / 2
    inside = np.all((before >= 0) & (before <= np.array(image.shape[::-1]) - 1), axis=-1)
    if inside.sum() < _FEWEST_WHOLE_DISCS:
        return False
    dark = np.mean(_levels(image, before[inside]) < middle)
    bright = np.mean(_levels(image, between) > middle)
    return bool(dark >= _DISC_SHARE and bright >= _DISC_SHARE)


def _levels(image: Grey, places: Array) -> Array:
    """Levels of the nearest pixels; positions outside the image are clipped to its border."""
    column, row = np.moveaxis(np.rint(places).astype(np.int64), -1, 0)
    height, width = image.shape
    return np.asarray(image[row.clip(0, height - 1), column.clip(0, width - 1)], dtype=np.float64)
