"""Drawings of the local page of a capture: the error over samples, an image with its detections."""

from __future__ import annotations

from basecal.acquisition.watching import Snapshot
from basecal.geometry import Array
from basecal.reporting.decision.outlook import error_curve
from basecal.reporting.figures.figure import Figure
from basecal.reporting.svg import dots, drawing, element

_WIDTH = 400.0


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
