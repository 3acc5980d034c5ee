"""Drawings of the local page of a capture: coverage, the error over samples, an image with its detections."""

from __future__ import annotations

from basecal.acquisition.coverage import Coverage
from basecal.acquisition.watching import Snapshot
from basecal.geometry import Array
from basecal.reporting.decision.outlook import error_curve
from basecal.reporting.figures.figure import Figure
from basecal.reporting.svg import dots, drawing, element

_TILE_PX = 20.0
_WIDTH = 400.0


def coverage_drawing(coverage: Coverage) -> str:
    """The image's parts, those in which points were seen full."""
    rows, columns = coverage.cells.shape
    cells = (
        element(
            "rect",
            class_="tile" if coverage.cells[row, column] else "frame",
            x=column * _TILE_PX + 1,
            y=row * _TILE_PX + 1,
            width=_TILE_PX - 2,
            height=_TILE_PX - 2,
        )
        for row in range(rows)
        for column in range(columns)
    )
    label = f"{100 * coverage.share:.0f} % of the image is covered"
    return drawing(columns * _TILE_PX, rows * _TILE_PX, label, *cells)


def progress_figure(snapshot: Snapshot) -> Figure | None:
    """The expected error at the task over samples with its tolerance, or else the base's sigma; None before two."""
    if len(snapshot.errors) > 1:
        return error_curve("expected error at the task, 95 %", snapshot.errors, snapshot.tolerance_m)
    sigmas = [(sigma.samples, sigma.t_m) for sigma in snapshot.sigmas]
    return error_curve("sigma of the base", sigmas, None) if len(sigmas) > 1 else None


def picture_drawing(address: str, size_px: tuple[int, int], pixels: Array, camera: str) -> str:
    """An image with dots at points, (n, 2) [px]."""
    scale = _WIDTH / size_px[0]
    height = size_px[1] * scale
    return drawing(
        _WIDTH,
        height,
        f"last image of {camera}, {len(pixels)} points found",
        element("image", href=address, width=f"{_WIDTH:g}", height=f"{height:.1f}"),
        element("path", class_="found", d=dots((pixels + 0.5) * scale)),
    )
