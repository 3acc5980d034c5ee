"""Thumbnails of views with their points, largest residuals first."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.cell import Calibration, Cell, Recording, Sample
from basecal.fields.digits import two_digits
from basecal.geometry import Array, BoolArray
from basecal.reporting.figures.camera_points import points_by_camera, some_points
from basecal.reporting.svg import dots, drawing, element, nice_ceiling, path, segments

_MOST_USED, _MOST_LEFT_OUT = 18, 6  # thumbnails of used views and of left-out views
_WIDTH = 360  # [px]: twice the width on the page, for high-resolution screens
_MOST_BYTES = 1_000_000  # of all images, so that a page stays below 3 MB
_MOST_POINTS = 300  # drawn in an image
_LARGE_WIDTH = 960  # [px] of a single large image
_LONGEST_SHARE = 0.05  # of an image's width, for a residual of `longest_px`


Thumbnail = tuple[Markup, PointResiduals, str]
"""An image with its points, the residuals of its view, and a text about them."""


def thumbnails(
    cell: Cell, recording: Recording, calibration: Calibration, residuals: Sequence[PointResiduals]
) -> tuple[list[Thumbnail], str] | None:
    """Thumbnails of the used views with the largest residuals and of some left-out views; None if there are none.

    Args:
        cell: The calibrated cell.
        recording: The recording, whose images are read.
        calibration: The calibration.
        residuals: Residuals of the points of all views.
    """
    samples = {sample.sample: sample for sample in recording.samples}
    views = sorted(_views(residuals, samples), key=lambda view: -_rms_px(view))
    chosen = [view for view in views if view.used.any()][:_MOST_USED]
    chosen += [view for view in views if not view.used.any()][:_MOST_LEFT_OUT]
    longest_px = nice_ceiling(2 * (calibration.residuals.rms_px or max(map(_rms_px, chosen), default=0.0)))
    pictures, room = list[Thumbnail](), _MOST_BYTES
    for view in chosen:
        svg = _picture(cell, recording, samples[int(view.sample[0])], view.camera, view, longest_px, _WIDTH)
        if svg is None or len(svg) > room:
            continue
        room -= len(svg)
        state = "" if view.used.any() else ", left out"
        pictures.append((svg, view, f"{view.camera}, {two_digits(_rms_px(view))} px rms{state}"))
    caption = (
        f"{len(pictures)} of {len(views)} views. Circles: detected points; orange ones were left out. Lines: towards "
        f"their predictions; {longest_px:g} px are drawn as a twentieth of the image's width."
    )
    return (pictures, caption) if pictures else None


def sample_pictures(
    cell: Cell, recording: Recording, calibration: Calibration, residuals: Sequence[PointResiduals], number: int
) -> Iterator[Markup]:
    """Drawings of one sample's images with their points; unreadable images are left out.

    Args:
        cell: The calibrated cell.
        recording: The recording, whose images are read.
        calibration: The calibration.
        residuals: Residuals of the points of all views; an image without points is drawn without marks.
        number: Number of the sample.
    """
    longest_px = nice_ceiling(2 * (calibration.residuals.rms_px or 0.0))
    for sample in (each for each in recording.samples if each.sample == number):
        views = {view.camera: view for view in _views(residuals, {number: sample})}
        for camera in sample.images:
            drawn = _picture(cell, recording, sample, camera, views.get(camera), longest_px, _LARGE_WIDTH)
            if drawn is not None:
                yield drawn


def _views(residuals: Sequence[PointResiduals], samples: Mapping[int, Sample]) -> Iterator[PointResiduals]:
    """Points of each camera in each sample with an image."""
    for camera, points in points_by_camera(residuals).items():
        for number in np.unique(points.sample).tolist():
            if number in samples and camera in samples[number].images:
                yield some_points(points, points.sample == number)


def _rms_px(view: PointResiduals) -> float:
    """Rms residual per coordinate of the used points, or of all points if none is used."""
    residuals = view.off_px[view.used] if view.used.any() else view.off_px
    return float(np.sqrt(np.mean(residuals**2)))


def _picture(
    cell: Cell,
    recording: Recording,
    sample: Sample,
    camera: str,
    view: PointResiduals | None,
    longest_px: float,
    width: int,
) -> Markup | None:
    """An image with the points of its view; None if the image cannot be read."""
    from basecal.vision.image_file import read_bytes
    from basecal.vision.thumbnail import thumbnail

    size_px = cell.cameras[camera].size_px
    if recording.folder is None or size_px is None:
        return None
    jpeg = thumbnail(read_bytes(Path(recording.folder) / sample.images[camera]), size_px, width)
    if jpeg is None:
        return None
    label = f"sample {sample.sample} seen by {camera}"
    if view is None:
        nothing = np.zeros((0, 2))
        return image_drawing(label, jpeg, size_px, nothing, nothing, np.zeros(0, dtype=bool))
    some = slice(None, None, -(-len(view.pixels) // _MOST_POINTS))
    offsets = view.off_px[some] * (_LONGEST_SHARE * size_px[0] / longest_px)
    return image_drawing(label, jpeg, size_px, view.pixels[some], offsets, view.used[some])


def image_drawing(
    label: str, jpeg: bytes, size_px: tuple[int, int], pixels: Array, offsets: Array, mask: BoolArray
) -> Markup:
    """A drawing of an image with points.

    Args:
        label: Label of the drawing.
        jpeg: The image, of any size.
        size_px: Original size of the image.
        pixels: Points, (n, 2) [px].
        offsets: Lines drawn from used points, (n, 2) [px].
        mask: Whether points were used, (n,); unused ones have another colour.
    """
    scale = _WIDTH / size_px[0]
    height = size_px[1] * scale
    points, lines = (pixels + 0.5) * scale, offsets * scale
    address = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
    return drawing(
        _WIDTH,
        height,
        label,
        element("image", href=address, width=_WIDTH, height=height),
        path("off", segments(np.stack([points, points + lines], 1)[mask])),
        path("found", dots(points[mask])),
        path("left-out", dots(points[~mask])),
    )
