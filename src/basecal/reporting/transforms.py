"""Each transform of a calibration as the words and numbers of the page, those of the text."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from basecal.cell import Calibration, Cell
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import frame_names
from basecal.exchange.ros2 import static_transform_publisher
from basecal.exchange.urdf import numbers, origin_line
from basecal.geometry import Array
from basecal.reporting.text import sigma_norms

_SIGNIFICANT_DIGITS = 4
Pasted = Mapping[str, Mapping[str, str]]
"""Texts by transform, and then by kind."""


@dataclass(frozen=True)
class Row:
    """Three numbers along x, y, z in one unit, their sigmas and the sigmas' norm; None if given as fixed."""

    name: str
    unit: str
    values: tuple[str, ...]
    sigmas: tuple[str, ...] | None
    norm: str | None


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
    rows: tuple[Row, ...]
    quaternion: tuple[str, ...]
    copies: tuple[ToCopy, ...]
    ways: tuple[str, ...]


def transform_view(name: str, cell: Cell, calibration: Calibration, pasted: Pasted) -> TransformView:
    """How the page shows a transform that the calibration has, with what is pasted of all transforms."""
    estimate, status = calibration[name], calibration.status.get(name, "free")
    is_point = name in calibration.points
    given = status == "fixed"
    norm_mm, norm_deg = sigma_norms(estimate)
    rows = [_row("t", "mm", estimate.mean.translation * 1e3, None if given else (estimate.sigma_t * 1e3, norm_mm))]
    if not is_point:
        sigma_deg = np.degrees(estimate.sigma_r)
        rows.append(_row("rpy", "deg", np.degrees(estimate.mean.rpy), None if given else (sigma_deg, norm_deg)))
    parent, _, child = name.partition("_from_")
    copies = () if is_point else tuple(_copies(name, cell, calibration, pasted))
    return TransformView(
        name=name,
        status=f"{status}, a point" if is_point else status,
        parent=parent,
        child=child,
        rows=tuple(rows),
        quaternion=() if is_point else tuple(numbers(estimate.mean.quaternion).split()),
        copies=copies,
        ways=tuple(dict.fromkeys(copy.way for copy in copies)),
    )


def _row(name: str, unit: str, values: Array, sigma: tuple[Array, float] | None) -> Row:
    shown = tuple(numbers(values, _SIGNIFICANT_DIGITS).split())
    if sigma is None:
        return Row(name, unit, shown, None, None)
    return Row(
        name, unit, shown, tuple(numbers(sigma[0], _SIGNIFICANT_DIGITS).split()), f"{sigma[1]:.{_SIGNIFICANT_DIGITS}f}"
    )


def _copies(name: str, cell: Cell, calibration: Calibration, pasted: Pasted) -> Iterator[ToCopy]:
    """What other programs take of a transform: of the same the other way round, too, where it is pasted."""
    estimate = calibration[name]
    parent, _, child = name.partition("_from_")
    covariance = ",\n ".join(json.dumps([float(f"{value:.6g}") for value in row]) for row in estimate.covariance)
    published = static_transform_publisher(estimate.mean, *frame_names(cell, name))
    order = f"translation [m] before rotation [rad], in axes of {child}"
    yield ToCopy("urdf", "origin of a joint, m and rad", name, origin_line(estimate.mean))
    yield ToCopy("ros2 run", "publishes on /tf_static", name, published)
    yield ToCopy("covariance", order, name, f"[{covariance}]")
    for way in (name, f"{child}_from_{parent}"):
        for kind, text in pasted.get(way, {}).items():
            yield ToCopy(kind, EXPORTERS[kind].words, way, text.strip("\n"))
