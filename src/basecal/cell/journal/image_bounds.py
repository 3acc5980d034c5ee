"""Pixels of a recording against the images of its cameras: what lies outside says that a size is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell.cell import Cell, CellCamera
from basecal.cell.journal.sample_values import Where
from basecal.cell.recording import PixelObservation, Sample
from basecal.geometry import Array

_MARGIN_PX = 0.05  # of the image's width: noise of points at its border stays within, sizes differ by more
_OUTSIDE_SHARE = 0.05  # of the points: fewer are stray ones, which are found as outliers


def check_image_bounds(samples: Sequence[Sample], lines: Mapping[int, int], path: str, cell: Cell) -> None:
    """Check that the pixels of each camera lie in its image, but for a few stray ones.

    Args:
        samples: Those that were read.
        lines: Line of each sample, by its number.
        path: The file they stand in.
        cell: Its cameras.

    Raises:
        DatasetError: naming the first line with a pixel outside, and which size looks wrong.
    """
    for name, camera in cell.cameras.items():
        views = [
            (sample.sample, seen)
            for sample in samples
            for seen in sample.observations
            if isinstance(seen, PixelObservation) and seen.camera == name
        ]
        if camera.size_px is None or not views:
            continue
        pixels = np.concatenate([seen.pixels for _, seen in views])
        outside = ~_inside_mask(pixels, camera.size_px)
        if np.mean(outside) <= _OUTSIDE_SHARE:
            continue
        sample = next(n for n, s in views if not np.all(_inside_mask(s.pixels, camera.size_px)))
        width, height = camera.size_px
        share = f"{np.count_nonzero(outside)} of {len(pixels)} pixels of {name!r} lie outside its {width} x {height} px"
        raise Where(path, lines[sample]).error("observations", f"{share}{_cause(camera, pixels)}")


def _inside_mask(pixels: Array, size_px: tuple[int, int]) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether pixels, (n, 2), lie in an image, (n,)."""
    margin = _MARGIN_PX * size_px[0]
    return np.asarray(np.all((pixels >= -margin) & (pixels <= np.array(size_px) - 1 + margin), -1))


def _cause(camera: CellCamera, pixels: Array) -> str:
    """Which number looks wrong, and what to do."""
    width, height = camera.size_px or (0, 0)
    u, v = np.max(pixels, axis=0)
    reach = f"; they reach to ({u:.0f}, {v:.0f})"
    if width == height or np.mean(_inside_mask(pixels, (height, width))) < 1 - _OUTSIDE_SHARE:
        return f"{reach}: size_px is of another resolution, give that of the images the points were found in"
    lens = None if camera.intrinsics is None else camera.intrinsics.camera
    middle = (np.array([width, height]) - 1) / 2
    if lens is not None and np.linalg.norm(lens.center - middle) < np.linalg.norm(lens.center - middle[::-1]):
        # The lens's principal point suits the size as stated.
        return (
            f"{reach}: u and v of the points look swapped, or width and height in both size_px and the camera matrix. "
            "u counts along the width"
        )
    return f"{reach}: width and height look swapped, expected size_px: [{height}, {width}]"
