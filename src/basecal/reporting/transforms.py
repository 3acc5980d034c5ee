"""Transforms of a calibration in formats of other programs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from basecal.cell import Calibration, Cell
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import frame_names
from basecal.exchange.ros2 import static_transform_publisher
from basecal.exchange.urdf import origin_line

TransformTexts = Mapping[str, Mapping[str, str]]
"""Texts by transform and format."""


class PasteText(NamedTuple):
    """A text to paste into another program.

    Attributes:
        kind: Name of the format.
        about: Description of the format.
        transform: Name of the transform or of its inverse.
        text: The text.
    """

    kind: str
    about: str
    transform: str
    text: str


def copies(name: str, cell: Cell, calibration: Calibration, texts: TransformTexts) -> list[PasteText]:
    """Texts of a transform for other programs, those of the cell's own drivers first; empty for a point.

    Args:
        name: Name of an estimated transform.
        cell: The calibrated cell.
        calibration: The calibration.
        texts: Texts of all transforms.
    """
    if name in calibration.points:
        return []
    drivers = {robot.driver.kind for robot in cell.robots.values() if robot.driver is not None}
    return sorted(_copies(name, cell, calibration, texts), key=lambda copy: copy.kind not in drivers)


def _copies(name: str, cell: Cell, calibration: Calibration, texts: TransformTexts) -> Iterator[PasteText]:
    """Texts of a transform for other programs, and of its inverse for formats that need it."""
    estimate = calibration[name]
    parent, child = name.split("_from_")
    covariance = ",\n ".join(json.dumps([float(f"{value:.6g}") for value in row]) for row in estimate.covariance)
    published = static_transform_publisher(estimate.mean, *frame_names(cell, name))
    order = f"translation [m] before rotation [rad], in axes of {child}"
    yield PasteText("urdf", "origin of a joint, m and rad", name, origin_line(estimate.mean))
    yield PasteText("ros2 run", "publishes on /tf_static", name, published)
    yield PasteText("covariance", order, name, f"[{covariance}]")
    for transform in (name, f"{child}_from_{parent}"):
        for kind, text in texts.get(transform, {}).items():
            yield PasteText(kind, EXPORTERS[kind].words, transform, text.strip("\n"))
