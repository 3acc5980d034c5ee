"""Images of printed targets through a lens, with blur and noise: exact edges, no GPU.

The outlines of black areas are projected through the lens. The area that they cover in each pixel is computed, so that
edges are correct to a thousandth of a pixel. Point spread, noise and quantisation follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.cell.target import Sheet, Target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detection import Image
from basecal.vision.draw.drawing import target_drawing

_EDGE_PX = 3.0  # length of a straight piece of an edge: even a strong lens bends it by only a thousandth of a pixel
_MOST_CUTS = 4000  # pieces of one edge, enough for one as long as the widest image
_REACH_SIGMAS = 4.5  # sigmas of the point spread: the rest is below a thousandth of a level
_TEXTURE_PX = (8, 32, 128)  # scales of the background's structure: of corners, of boards, of shadows
_SUPERSAMPLING = 2  # a Gaussian sampled once per pixel would leave steps of half a percent in an edge
_DISC_SIDES = 120  # of a polygon of the same area: its outline deviates by less than 0.0003 of the radius

Levels = NDArray[np.float32]
View = tuple[Target, SE3]


@dataclass(frozen=True)
class SceneSettings:
    """The backdrop of a scene; levels are grey levels of an 8-bit image for any `bits`.

    Attributes:
        background: Mean level of the background.
        texture: Standard deviation of the background's texture; 0 for a plain background.
        bits: Bits of the image, 8 or 16.
    """

    background: float = field(default=110.0, kw_only=True)
    texture: float = field(default=0.0, kw_only=True)
    bits: int = field(default=8, kw_only=True)


@dataclass(frozen=True)
class RenderSettings(SceneSettings):
    """Exposure of a print.

    Attributes:
        black: Level of ink.
        white: Level of paper.
        blur_px: Sigma of the Gaussian point spread, without the integration over the pixel's square.
        noise: Sigma of Gaussian noise, in grey levels.
    """

    black: float = 30.0
    white: float = 200.0
    blur_px: float = 0.7
    noise: float = 2.0


def render(
    camera: Camera, target: Target, camera_from_target: SE3, settings: RenderSettings | None = None, seed: int = 0
) -> Image:
    """Render an image of a printed target, (h, w).

    Args:
        camera: The lens; `size_px` must be known.
        target: A printed target.
        camera_from_target: Pose of the target.
        settings: Exposure of the print.
        seed: Seed of the noise and the background's texture.

    Raises:
        InputError: if the camera has no size, or the target is not printed.
    """
    exposure = settings or RenderSettings()
    return expose(radiance(camera, [(target, camera_from_target)], exposure, seed), exposure, seed)


def radiance(camera: Camera, views: Sequence[View], settings: RenderSettings, seed: int = 0) -> Array:
    """Radiance on the sensor before noise and rounding, (h, w) in grey levels; nearer sheets occlude others.

    Raises:
        InputError: if the camera has no size, or a target is not printed.
    """
    size_px = checked_size(camera)
    plain = background(size_px, settings.background, settings.texture, seed).astype(np.float32)
    return apply_point_spread(paint_targets(supersample(plain), camera, views, settings), settings, size_px)


def supersample(levels: Levels) -> Levels:
    """Repeat levels, (h, w), onto the supersampled grid, (2 h, 2 w)."""
    return levels.repeat(_SUPERSAMPLING, axis=0).repeat(_SUPERSAMPLING, axis=1)


def paint_targets(fine: Levels, camera: Camera, views: Sequence[View], settings: RenderSettings) -> Levels:
    """Paint targets onto a supersampled image in place and return it; nearer sheets occlude others.

    Raises:
        InputError: if a target is not printed.
    """
    placed = [(pose @ sheet.target_from_sheet, sheet) for target, pose in views for sheet in target_drawing(target)]
    for camera_from_sheet, sheet in sorted(placed, key=lambda each: -float(each[0].translation[2])):
        facing = float(camera_from_sheet.rotation[:, 2] @ camera_from_sheet.translation) > 0
        paper = _project_edges(camera, camera_from_sheet, _tiles(sheet))
        window = _window(paper, fine.shape)
        if window is None:
            continue
        part = fine[window]
        part += _coverage(paper if facing else paper[:, ::-1], window) * (np.float32(settings.white) - part)
        if not facing:
            continue
        # Discs are polygons of the same area.
        angle = 2 * np.pi * np.arange(_DISC_SIDES) / _DISC_SIDES
        stretch = np.sqrt(np.pi / (_DISC_SIDES / 2 * np.sin(2 * np.pi / _DISC_SIDES)))
        circle = stretch * np.stack([np.cos(angle), np.sin(angle)], -1)
        discs = np.asarray(sheet.discs[:, None, :2] + sheet.discs[:, 2, None, None] * circle)
        black = [_project_edges(camera, camera_from_sheet, loops) for loops in (_boxes(sheet.rectangles), discs)]
        part += np.float32(settings.black - settings.white) * _coverage(np.concatenate(black), window)
    return fine


def apply_point_spread(fine: Levels, settings: RenderSettings, size_px: tuple[int, int]) -> Array:
    """Blur a supersampled image by the point spread and reduce it to pixels, (h, w)."""
    return np.asarray(
        cv2.resize(blur_image(fine, _SUPERSAMPLING * settings.blur_px), size_px, interpolation=cv2.INTER_AREA),
        dtype=np.float64,
    )


def expose(levels: Array, settings: RenderSettings, seed: int = 0) -> Image:
    """Add noise to grey levels, round, and clip to the range of the image, (h, w)."""
    noisy = np.random.default_rng([seed, 1]).standard_normal(levels.shape, dtype=np.float32)
    noisy *= np.float32(settings.noise)
    noisy += levels
    return quantise(noisy, settings.bits)


def quantise(levels: Array | Levels, bits: int) -> Image:
    """Scale levels of an 8-bit image to `bits`, round and clip, (h, w).

    Raises:
        InputError: if `bits` is neither 8 nor 16.
    """
    if bits not in (8, 16):
        raise InputError(f"bits is {bits}, expected 8 or 16")
    full = 2**bits - 1
    whole = np.clip(levels * levels.dtype.type(full / 255.0), 0, full)
    return np.asarray(np.rint(whole, out=whole), dtype=np.uint8 if bits == 8 else np.uint16)


def checked_size(camera: Camera) -> tuple[int, int]:
    """Width and height of a camera's images.

    Raises:
        InputError: if the camera has no size.
    """
    if camera.size_px is None:
        raise InputError("the camera has no size_px; an image needs a width and a height")
    return camera.size_px


def background(size_px: tuple[int, int], level: float, texture: float, seed: int) -> Array:
    """A plain or textured background, (h, w); the texture is smooth noise of three scales."""
    width, height = size_px
    image = np.full((height, width), float(level))
    rng = np.random.default_rng([seed, 2])
    for scale in _TEXTURE_PX if texture > 0 else ():
        coarse = rng.standard_normal((height // scale + 3, width // scale + 3))
        image += texture / np.sqrt(len(_TEXTURE_PX)) * cv2.resize(coarse, size_px, interpolation=cv2.INTER_CUBIC)
    return image


def blur_image(image: Levels, sigma_px: float) -> Levels:
    """Blur an image by a Gaussian point spread, (h, w)."""
    if sigma_px <= 0:
        return image
    half = int(np.ceil(_REACH_SIGMAS * sigma_px))
    return np.asarray(cv2.GaussianBlur(image, (2 * half + 1,) * 2, sigma_px, borderType=cv2.BORDER_REPLICATE))


def _window(edges: Array, shape: tuple[int, ...]) -> tuple[slice, slice] | None:
    """Rows and columns of the supersampled image that edges cover; None if they are outside."""
    if not len(edges):
        return None
    low = np.maximum(np.floor(edges.min(axis=(0, 1))), 0).astype(int)
    high = np.minimum(np.ceil(edges.max(axis=(0, 1))) + 1, shape[::-1]).astype(int)
    return None if np.any(low >= high) else (slice(low[1], high[1]), slice(low[0], high[0]))


def _coverage(edges: Array, window: tuple[slice, slice]) -> Levels:
    rows, columns = window
    origin = np.array([columns.start, rows.start])
    return coverage(edges - origin, (columns.stop - columns.start, rows.stop - rows.start)).astype(np.float32)


def _tiles(sheet: Sheet) -> Array:
    """Tiles of the paper, about a pitch wide, (n, 4, 2), so that only tiles outside the lens's field are left out."""
    left, top, right, bottom = sheet.paper
    columns, rows = (max(1, round(float(extent) / sheet.pitch)) for extent in (right - left, bottom - top))
    x, y = np.linspace(left, right, columns + 1), np.linspace(top, bottom, rows + 1)
    low = np.stack(np.meshgrid(x[:-1], y[:-1]), -1).reshape(-1, 2)
    high = np.stack(np.meshgrid(x[1:], y[1:]), -1).reshape(-1, 2)
    return _boxes(np.concatenate([low, high], -1))


def _boxes(rectangles: Array) -> Array:
    """Corners of rectangles, clockwise on the screen, (n, 4, 2)."""
    left, top, right, bottom = rectangles.T
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return np.stack([np.stack(corner, -1) for corner in corners], axis=1)


def _project_edges(camera: Camera, camera_from_sheet: SE3, loops: Array) -> Array:
    """Project loops into the supersampled image as edges, (m, 2, 2), so short that distortion bends none visibly."""
    is_visible = Camera(camera.model, camera.parameters).sees(camera_from_sheet @ _points_on_plane(loops)).all(axis=1)
    start = loops[is_visible]
    end = np.roll(start, -1, axis=1)
    pixels = camera.project(camera_from_sheet @ _points_on_plane(start))
    start, end = start.reshape(-1, 2), end.reshape(-1, 2)
    length = np.linalg.norm(np.roll(pixels, -1, axis=1) - pixels, axis=-1).ravel()
    count = np.clip(np.ceil(length / _EDGE_PX), 1, _MOST_CUTS).astype(np.int64)
    edge = np.repeat(np.arange(len(start)), count)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    # Weighted so that an edge and its reverse pass through the same points.
    shares = [((step + k) / count[edge])[:, None] for k in (0, 1)]
    ends = [start[edge] * (1 - share) + end[edge] * share for share in shares]
    fine: Array = np.stack([camera.project(camera_from_sheet @ _points_on_plane(each)) for each in ends], axis=1)
    return np.asarray((fine + 0.5) * _SUPERSAMPLING - 0.5)


def _points_on_plane(plane: Array) -> Array:
    """Points (..., 3) with z = 0 of points (..., 2) of a sheet."""
    return np.concatenate([plane, np.zeros((*plane.shape[:-1], 1))], axis=-1)


def coverage(outlines: Array, size_px: tuple[int, int]) -> Array:
    """Area of each pixel inside closed outlines that do not overlap, (h, w), in [0, 1].

    Args:
        outlines: (m, 2, 2) edges, start and end in pixels; the centre of the top-left pixel is (0, 0). The edges form
            closed outlines, clockwise on the screen.
        size_px: Width and height.
    """
    width, height = size_px
    edges = outlines + 0.5
    inside = (edges[..., 1].max(-1) > 0) & (edges[..., 1].min(-1) < height) & (edges[..., 0].min(-1) < width)
    pieces = _cut(_cut(edges[inside], axis=1), axis=0)
    middle = pieces.mean(axis=1)
    row = np.floor(middle[:, 1]).astype(np.int64)
    is_inside = (row >= 0) & (row < height) & (middle[:, 0] < width)
    x, row, rise = np.maximum(middle[is_inside, 0], 0.0), row[is_inside], (pieces[:, 1, 1] - pieces[:, 0, 1])[is_inside]
    column = np.floor(x).astype(np.int64)
    right = rise * (x - column)
    index = row * (width + 1) + column
    total = np.bincount(index, rise - right, height * (width + 1)) + np.bincount(index + 1, right, height * (width + 1))
    return -np.cumsum(total.reshape(height, width + 1)[:, :width], axis=1)


def _cut(edges: Array, axis: int) -> Array:
    """Split edges at integers of the coordinate `axis`, (n, 2, 2)."""
    low, high = np.sort(edges[:, :, axis], axis=1).T
    first = np.floor(low)
    count = np.maximum(np.ceil(high) - first, 1).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), count)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    start, end = edges[edge, 0], edges[edge, 1]
    rising = end[:, axis] >= start[:, axis]
    # Pieces are counted from the low end, in reverse for a falling edge.
    floor, top = low[edge], high[edge]
    below = np.clip(first[edge] + step, floor, top)
    above = np.clip(first[edge] + step + 1, floor, top)
    length = np.where(top > floor, top - floor, 1.0)
    enter, leave = (np.where(rising, below, above), np.where(rising, above, below))
    origin = start[:, axis]
    sense = np.where(rising, 1.0, -1.0) / length
    near, far = ((enter - origin) * sense)[:, None], ((leave - origin) * sense)[:, None]
    flat = (top == floor)[:, None]
    pieces = np.stack([start + near * (end - start), start + np.where(flat, 1.0, far) * (end - start)], axis=1)
    pieces[:, 0, axis], pieces[:, 1, axis] = enter, leave
    return pieces
