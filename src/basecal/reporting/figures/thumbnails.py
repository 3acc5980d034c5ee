"""Small images of views with what was found in them, the worst first."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.cell import Calibration, Cell, Recording, Sample
from basecal.geometry import Array, BoolArray
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.svg import dots, drawing, element, nice_ceiling, segments

_MOST_USED, _MOST_LEFT_OUT = 18, 6  # images of views that were used, and of those left out: some rows of each
_WIDTH = 360  # [px]: twice what an image takes on the page, for screens that are fine
_MOST_BYTES = 700_000  # of all images, so that a page stays below 3 MB
_MOST_POINTS = 300  # drawn in an image
_LARGE_WIDTH = 960  # [px] of one image that is looked at alone
_LONGEST_SHARE = 0.05  # of an image's width, for a residual as long as the ruler's


@dataclass(frozen=True)
class Thumbnail:
    """An image with its words.

    Attributes:
        svg: The image with points on it.
        sample: Number of its sample.
        camera: That took it.
        words: By whom, and how it fits.
        left_out: Whether the view was left out whole.
    """

    svg: str
    sample: int
    camera: str
    words: str
    left_out: bool


@dataclass(frozen=True)
class Thumbnails:
    """Images with what holds for all of them."""

    pictures: tuple[Thumbnail, ...]
    caption: str


@dataclass(frozen=True, eq=False)
class _View:
    """Points that a camera saw in a sample, (n, 2), their distances, whether used; and its rms [px]."""

    sample: int
    camera: str
    pixels: Array
    off_px: Array
    used: BoolArray

    @property
    def is_unused(self) -> bool:
        """Whether nothing of it was used."""
        return not np.any(self.used)

    @property
    def rms_px(self) -> float:
        """Per coordinate, of the points that were used, or else of all."""
        off = self.off_px if self.is_unused else self.off_px[self.used]
        return float(np.sqrt(np.mean(off**2)))


def thumbnails(
    cell: Cell, recording: Recording, calibration: Calibration, residuals: Sequence[PointResiduals]
) -> Thumbnails | None:
    """Images of the views that fit worst and of some that were left out; None if no images are recorded.

    Args:
        cell: What was calibrated.
        recording: Its images are read.
        calibration: What came out.
        residuals: The points of all views.
    """
    images = {sample.sample: sample for sample in recording.samples if sample.images}
    if recording.folder is None or not images or not residuals:
        return None
    views = sorted(_views(residuals, images), key=lambda view: -view.rms_px)
    chosen = [view for view in views if not view.is_unused][:_MOST_USED]
    chosen += [view for view in views if view.is_unused][:_MOST_LEFT_OUT]
    rms = calibration.residuals.rms_px or max((view.rms_px for view in chosen), default=0.0)
    longest_px = nice_ceiling(2 * rms)
    pictures = list(_pictures(cell, Path(recording.folder), images, chosen, longest_px))
    if not pictures:
        return None
    caption = (
        f"{len(pictures)} of {len(views)} views. Circles: points as they were found; orange ones were left out. Lines: "
        f"towards where they are predicted, {longest_px:g} px as long as a twentieth of the image is wide."
    )
    return Thumbnails(tuple(pictures), caption)


def sample_pictures(
    cell: Cell, recording: Recording, calibration: Calibration, residuals: Sequence[PointResiduals], number: int
) -> list[str]:
    """Drawings of one sample's images with their points; those that cannot be read are left out.

    Args:
        cell: What was calibrated.
        recording: Its images are read.
        calibration: What came out.
        residuals: The points of all views; an image without any is drawn bare.
        number: Of the sample.
    """
    found = [sample for sample in recording.samples if sample.sample == number]
    if not found or recording.folder is None:
        return []
    views = {view.camera: view for view in _views(residuals, {number: found[0]})}
    nothing = np.zeros((0, 2))
    longest_px = nice_ceiling(2 * (calibration.residuals.rms_px or 0.0))
    drawn = []
    for camera in found[0].images:
        view = views.get(camera, _View(number, camera, nothing, nothing, np.zeros(0, dtype=bool)))
        size_px = cell.cameras[camera].size_px
        jpeg = _jpeg(Path(recording.folder) / found[0].images[camera], size_px, _LARGE_WIDTH)
        if jpeg is not None and size_px is not None:
            drawn.append(_drawing(view, jpeg, size_px, longest_px))
    return drawn


def _jpeg(path: Path, size_px: tuple[int, int] | None, width: int) -> bytes | None:
    from basecal.vision.image_file import read_bytes
    from basecal.vision.thumbnail import thumbnail

    data = read_bytes(path)
    return None if isinstance(data, str) or size_px is None else thumbnail(data, size_px, width)


def _views(residuals: Sequence[PointResiduals], images: dict[int, Sample]) -> Iterator[_View]:
    """Observations of each camera in each sample that has its image."""
    for camera in dict.fromkeys(each.camera for each in residuals):
        of_camera = [each for each in residuals if each.camera == camera]
        sample, pixels, off_px, used = (
            np.concatenate([getattr(each, name) for each in of_camera])
            for name in ("sample", "pixels", "off_px", "used")
        )
        for number in np.unique(sample).tolist():
            if number in images and camera in images[number].images:
                own = sample == number
                yield _View(number, camera, pixels[own], off_px[own], used[own])


def _pictures(
    cell: Cell, folder: Path, images: dict[int, Sample], views: Sequence[_View], longest_px: float
) -> Iterator[Thumbnail]:
    """Images of images that can be read, as many as there is room for."""
    room = _MOST_BYTES
    for view in views:
        size_px = cell.cameras[view.camera].size_px
        jpeg = _jpeg(folder / images[view.sample].images[view.camera], size_px, _WIDTH)
        if jpeg is None or size_px is None or len(jpeg) > room:
            continue
        room -= len(jpeg)
        state = ", left out" if view.is_unused else ""
        words = f"{view.camera}, {two_digits(view.rms_px)} px rms{state}"
        yield Thumbnail(_drawing(view, jpeg, size_px, longest_px), view.sample, view.camera, words, view.is_unused)


def _drawing(view: _View, jpeg: bytes, size_px: tuple[int, int], longest_px: float) -> str:
    some = slice(None, None, max(1, -(-len(view.pixels) // _MOST_POINTS)))
    offsets = view.off_px[some] * (_LONGEST_SHARE * size_px[0] / longest_px)
    label = f"sample {view.sample} seen by {view.camera}"
    return image_drawing(label, jpeg, size_px, view.pixels[some], offsets, view.used[some])


def image_drawing(
    label: str, jpeg: bytes, size_px: tuple[int, int], pixels: Array, offsets: Array, mask: BoolArray
) -> str:
    """An image with points on it.

    Args:
        label: What it is.
        jpeg: The image, of any size.
        size_px: Its size as it was taken.
        pixels: (n, 2) [px].
        offsets: (n, 2) of lines from points that were used [px].
        mask: (n,) whether they were used; others have another colour.
    """
    scale = _WIDTH / size_px[0]
    height = size_px[1] * scale
    at, tip = (pixels + 0.5) * scale, (pixels + 0.5 + offsets) * scale
    address = f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
    return drawing(
        _WIDTH,
        height,
        label,
        element("image", href=address, width=f"{_WIDTH:g}", height=f"{height:.1f}"),
        element("path", class_="off", d=segments(np.stack([at[mask], tip[mask]], 1))),
        element("path", class_="found", d=dots(at[mask])),
        element("path", class_="left-out", d=dots(at[~mask])),
    )
