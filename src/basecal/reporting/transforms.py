"""Each transform of a calibration as the words and numbers of the page, those of the text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from basecal.cell import Calibration, Cell
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import frame_names
from basecal.exchange.ros2 import static_transform_publisher
from basecal.exchange.urdf import numbers, origin_line
from basecal.reporting.text import TransformRow, transform_rows

Pasted = Mapping[str, Mapping[str, str]]
"""Texts by transform, and then by kind."""


@dataclass(frozen=True)
class ToCopy:
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


@dataclass(frozen=True)
class TransformView:
    """A transform as the page shows it.

    Attributes:
        name: Such as `eye_base_from_hand_base`.
        status: `fixed`, `prior` or `free`; and that it is a point.
        parent: The frame its numbers are in.
        child: The frame whose axes the sigmas are along.
        rows: Translation, and rotation unless it is a point.
        quaternion: (x, y, z, w); nothing for a point.
        copies: Forms for other programs.
        ways: The transforms that these are of.
    """

    name: str
    status: str
    parent: str
    child: str
    rows: tuple[TransformRow, ...]
    quaternion: tuple[str, ...]
    copies: tuple[ToCopy, ...]
    ways: tuple[str, ...]


def transform_view(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> TransformView:
    """How the page shows a transform that the calibration has, with what is pasted of all transforms."""
    estimate, status = calibration[name], calibration.status.get(name, "free")
    is_point = name in calibration.points
    parent, _, child = name.partition("_from_")
    drivers = {robot.driver.kind for robot in cell.robots.values() if robot.driver is not None}
    copies = (
        [] if is_point else sorted(_copies(name, cell, calibration, clipboard), key=lambda c: c.kind not in drivers)
    )
    return TransformView(
        name=name,
        status=f"{status}, a point" if is_point else status,
        parent=parent,
        child=child,
        rows=tuple(transform_rows(name, calibration)),
        quaternion=() if is_point else tuple(numbers(estimate.mean.quaternion).split()),
        copies=tuple(copies),
        ways=tuple(dict.fromkeys(copy.way for copy in copies)),
    )


def _copies(name: str, cell: Cell, calibration: Calibration, clipboard: Pasted) -> Iterator[ToCopy]:
    """Notations of a transform that other programs read, and of its inverse where that is pasted."""
    estimate = calibration[name]
    parent, _, child = name.partition("_from_")
    covariance = ",\n ".join(json.dumps([float(f"{value:.6g}") for value in row]) for row in estimate.covariance)
    published = static_transform_publisher(estimate.mean, *frame_names(cell, name))
    order = f"translation [m] before rotation [rad], in axes of {child}"
    yield ToCopy("urdf", "origin of a joint, m and rad", name, origin_line(estimate.mean))
    yield ToCopy("ros2 run", "publishes on /tf_static", name, published)
    yield ToCopy("covariance", order, name, f"[{covariance}]")
    for way in (name, f"{child}_from_{parent}"):
        for kind, text in clipboard.get(way, {}).items():
            yield ToCopy(kind, EXPORTERS[kind].words, way, text.strip("\n"))
