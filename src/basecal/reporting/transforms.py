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

Pasted = Mapping[str, Mapping[str, str]]
"""Texts by transform and format."""


class ToCopy(NamedTuple):
    """A text to paste into another program.

    Attributes:
        kind: Name of the format.
        about: Description of the format.
        way: Name of the transform or of its inverse.
        text: The text.
    """

    kind: str
    about: str
    way: str
    text: str


def copies(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> list[ToCopy]:
    """Texts of a transform for other programs, those of the cell's own drivers first; empty for a point.

    Args:
        name: Name of an estimated transform.
        cell: The calibrated cell.
        calibration: The calibration.
        clipboard: Texts of all transforms.
    """
    if name in calibration.points:
        return []
    drivers = {robot.driver.kind for robot in cell.robots.values() if robot.driver is not None}
    return sorted(_copies(name, cell, calibration, clipboard), key=lambda copy: copy.kind not in drivers)


def _copies(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> Iterator[ToCopy]:
    """Texts of a transform for other programs, and of its inverse for formats that need it."""
    estimate = calibration[name]
    parent, child = name.split("_from_")
    covariance = ",\n ".join(json.dumps([float(f"{value:.6g}") for value in row]) for row in estimate.covariance)
    published = static_transform_publisher(estimate.mean, *frame_names(cell, name))
    order = f"translation [m] before rotation [rad], in axes of {child}"
    yield ToCopy("urdf", "origin of a joint, m and rad", name, origin_line(estimate.mean))
    yield ToCopy("ros2 run", "publishes on /tf_static", name, published)
    yield ToCopy("covariance", order, name, f"[{covariance}]")
    for way in (name, f"{child}_from_{parent}"):
        for kind, text in clipboard.get(way, {}).items():
            yield ToCopy(kind, EXPORTERS[kind].words, way, text.strip("\n"))
