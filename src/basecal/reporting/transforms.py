"""Each transform of a calibration as the words and numbers of the page, those of the text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from basecal.cell import Calibration, Cell
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import frame_names
from basecal.exchange.ros2 import static_transform_publisher
from basecal.exchange.urdf import numbers, origin_line
from basecal.reporting.decision.components import component_figure
from basecal.reporting.figures.figure import Figure
from basecal.reporting.text import TransformRow, status_words, transform_rows

Pasted = Mapping[str, Mapping[str, str]]
"""Texts by transform, and then by kind."""


class ToCopy(NamedTuple):
    """A text to paste into another program.

    Attributes:
        kind: For what, a word.
        about: In what form.
        way: Which transform it is of: this one, or the same the other way round.
        text: To paste.
    """

    kind: str
    about: str
    way: str
    text: str


class TransformView(NamedTuple):
    """A transform as the page shows it.

    Attributes:
        name: Such as `eye_base_from_hand_base`.
        status: `fixed`, `prior` or `free`; and that it is a point.
        rows: Translation, and rotation unless it is a point.
        quaternion: (x, y, z, w); empty for a point.
        copies: Forms for other programs, those of the cell's own drivers first; none for a point.
        figure: How well its position is known; None if it is fixed.
    """

    name: str
    status: str
    rows: list[TransformRow]
    quaternion: str
    copies: list[ToCopy]
    figure: Figure | None


def transform_view(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> TransformView:
    """How the page shows a transform that the calibration has, with what is pasted of all transforms."""
    estimate, status = calibration[name], status_words(name, calibration)
    asked_m = None if calibration.tolerance is None else calibration.tolerance.asked_m
    figure = None if status.startswith("fixed") else component_figure(name, estimate, asked_m)
    rows = list(transform_rows(name, calibration))
    if name in calibration.points:
        return TransformView(name, status, rows, "", [], figure)
    drivers = {robot.driver.kind for robot in cell.robots.values() if robot.driver is not None}
    copies = sorted(_copies(name, cell, calibration, clipboard), key=lambda copy: copy.kind not in drivers)
    return TransformView(name, status, rows, numbers(estimate.mean.quaternion), copies, figure)


def _copies(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> Iterator[ToCopy]:
    """Notations of a transform that other programs read, and of its inverse where that is pasted."""
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
