"""Figures of how a calibration fits: arrows over the image, a histogram, a bar for each view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.cell import SampleResidual
from basecal.geometry import Array, IntArray
from basecal.reporting.svg import drawing, element, round_up, segments, text, three_digits

_ARROW_SHARE = 0.05
_LARGEST_ARROWS = 50
_IMAGE_WIDTH = 640.0
_BINS = 41
_BIN_RANGE_RMS = 4.0
_HEIGHT = 100.0
_BAR = 10.0
_HEAD = 4.0


@dataclass(frozen=True)
class Figure:
    """A drawing with its words.

    Attributes:
        title: What it is of.
        svg: The drawing.
        caption: How to read it.
        x: Labels below, evenly spaced.
        y: Labels at the left from top to bottom, evenly spaced.
    """

    title: str
    svg: str
    caption: str
    x: tuple[str, ...] = ()
    y: tuple[str, ...] = ()


def arrow_figure(camera: str, size_px: tuple[int, int] | None, seen: Sequence[PointResiduals], most: int) -> Figure:
    """Residuals of one camera as arrows from where points were seen towards where they are predicted.

    Args:
        camera: Its name.
        size_px: Its image; where not known, as far as points were seen.
        seen: Its points, at least one.
        most: How many arrows are drawn: of more points the longest, and others evenly.
    """
    pixels = np.concatenate([each.pixels for each in seen])
    off = np.concatenate([each.off_px for each in seen])
    low, size = _frame(size_px, pixels)
    scale = _IMAGE_WIDTH / size[0]
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=-1))))
    bar_px = round_up(rms)
    longer = _ARROW_SHARE * _IMAGE_WIDTH / bar_px
    shown = _chosen(off, most)
    foot = (pixels[shown] - low) * scale
    tip = foot + off[shown] * longer
    height = float(size[1] * scale)
    ruler = np.array([[12.0, height - 12], [12 + bar_px * longer, height - 12]])
    svg = drawing(
        _IMAGE_WIDTH,
        height,
        f"reprojection errors in the image of {camera}",
        element("rect", class_="frame", width=f"{_IMAGE_WIDTH:g}", height=f"{height:.1f}"),
        element("path", class_="arrows", d=segments(np.stack([foot, tip], 1)) + _heads(foot, tip)),
        element("path", class_="ruler", d=segments([ruler])),
        element(
            "text", text(f"{bar_px:g} px"), class_="ruler-label", x=f"{ruler[1, 0] + 6:.1f}", y=f"{height - 7:.1f}"
        ),
    )
    few = f"{len(shown)} of {len(pixels)} points drawn, the largest among them"
    drawn = few if len(shown) < len(pixels) else f"{len(pixels)} points"
    times = three_digits(longer / scale)
    caption = f"From where a point was seen towards where it is predicted, {times} times as long; {drawn}."
    return Figure(f"{camera}, {size[0]:.0f} x {size[1]:.0f} px", svg, caption)


def _chosen(off: Array, most: int) -> IntArray:
    """Rows to draw."""
    if len(off) <= most:
        return np.arange(len(off))
    largest = np.argsort(np.sum(off**2, axis=-1))[-_LARGEST_ARROWS:]
    even = np.linspace(0, len(off) - 1, most - _LARGEST_ARROWS).round().astype(np.int64)
    return np.union1d(largest, even)


def _frame(size_px: tuple[int, int] | None, pixels: Array) -> tuple[Array, Array]:
    """Top left corner and size of what is drawn of an image [px]."""
    if size_px is not None:
        return np.array([-0.5, -0.5]), np.array(size_px, dtype=np.float64)
    low, high = pixels.min(0), pixels.max(0)
    size = np.maximum(high - low, 0.2 * max(float(np.max(high - low)), 1.0))
    return low - 0.05 * size, 1.1 * size


def _heads(foot: Array, tip: Array) -> str:
    """Heads of those arrows that are long enough to have one."""
    along = tip - foot
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    long = length[:, 0] > 2 * _HEAD
    unit, end = along[long] / length[long], tip[long]
    across = np.stack([-unit[:, 1], unit[:, 0]], -1)
    back = end - _HEAD * unit
    left, right = back + 0.5 * _HEAD * across, back - 0.5 * _HEAD * across
    return segments(np.concatenate([np.stack([left, end], 1), np.stack([right, end], 1)]))


def histogram(seen: Sequence[PointResiduals]) -> Figure:
    """Both coordinates' residuals as a histogram, beside the normal distribution of the same rms."""
    off = np.concatenate([each.off_px.ravel() for each in seen])
    rms = float(np.sqrt(np.mean(off**2)))
    limit = round_up(_BIN_RANGE_RMS * rms)
    edges = np.linspace(-limit, limit, _BINS + 1)
    counts = np.histogram(np.clip(off, -limit, limit), edges)[0]
    normal = len(off) * _normal(edges, rms)
    top = max(float(counts.max()), float(normal.max()))
    bars = [
        _bar(k * _BAR, _BAR, count / top, f"{edges[k]:.3g} to {edges[k + 1]:.3g} px: {count}")
        for k, count in enumerate(counts.tolist())
        if count
    ]
    curve = "L".join(f"{(k + 0.5) * _BAR:g} {_HEIGHT * (1 - share):.2f}" for k, share in enumerate(normal / top))
    line = element("path", class_="curve", d=f"M{curve}", vector_effect="non-scaling-stroke")
    svg = drawing(_BINS * _BAR, _HEIGHT, "histogram of residuals", *bars, line, stretch=True)
    outside = int(np.count_nonzero(np.abs(off) > limit))
    ends = f" {outside} beyond the ends stand in the outermost bars." if outside else ""
    caption = (
        f"{len(off)} coordinates, predicted minus seen; the line is the normal distribution of the same rms.{ends}"
    )
    labels = (f"{-limit:g}", f"{-limit / 2:g}", "0", f"{limit / 2:g}", f"{limit:g} px")
    return Figure("all residuals", svg, caption, labels)


def _normal(edges: Array, rms: float) -> Array:
    """Share of each bin in a normal distribution, by the density at its middle; zero without any spread."""
    if rms == 0:
        return np.zeros(len(edges) - 1)
    middle = 0.5 * (edges[1:] + edges[:-1]) / rms
    share: Array = np.diff(edges) / rms * np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi)
    return share


def _bar(left: float, width: float, share: float, label: str, sample: int | None = None) -> str:
    height = max(_HEIGHT * share, 0.5)
    title = element("title", text(label))
    place = {"x": f"{left + 0.05 * width:.2f}", "width": f"{0.9 * width:.2f}"}
    shown = element("rect", class_="bar", y=f"{_HEIGHT - height:.2f}", height=f"{height:.2f}", **place)
    if sample is None:
        return element("g", title, shown)
    whole = element("rect", class_="hit", x=f"{left:.2f}", y=0, width=f"{width:.2f}", height=f"{_HEIGHT:g}")
    return element("g", title, whole, shown, class_="view", data_sample=sample)


@dataclass(frozen=True)
class Quantity:
    """What the bars of views show: the field of `SampleResidual`, its factor to `unit`, and its name."""

    name: str
    field: str
    factor: float
    unit: str


QUANTITIES = (
    Quantity("reprojection error, rms", "rms_px", 1.0, "px"),
    Quantity("loop-closure error, length", "loop_m", 1e3, "mm"),
    Quantity("loop-closure error, angle", "loop_rad", float(np.degrees(1)), "deg"),
)


def bar_figure(views: Sequence[SampleResidual], quantity: Quantity, most: int) -> Figure | None:
    """A bar for each view by sample, of more than `most` the largest; None where no view has the quantity."""
    given = [
        (v.sample, getattr(v, quantity.field) * quantity.factor)
        for v in views
        if getattr(v, quantity.field) is not None
    ]
    if not given:
        return None
    largest = sorted(range(len(given)), key=lambda k: -given[k][1])[:most]
    shown = [given[k] for k in sorted(largest)]
    rms = float(np.sqrt(np.mean([value**2 for _, value in given])))
    top = round_up(max(value for _, value in shown))
    bars = [
        _bar(k * _BAR, _BAR, value / top, f"sample {sample}: {value:.3g} {quantity.unit}", sample)
        for k, (sample, value) in enumerate(shown)
    ]
    level = f"M0 {_HEIGHT * (1 - rms / top):.2f}H{len(shown) * _BAR:g}"
    line = element("path", class_="level", d=level, vector_effect="non-scaling-stroke")
    svg = drawing(len(shown) * _BAR, _HEIGHT, f"{quantity.name} by view", *bars, line, stretch=True)
    worst = f"the {len(shown)} largest of {len(given)} views; " if len(shown) < len(given) else ""
    caption = f"{worst}dashed: rms over all views, {rms:.3g} {quantity.unit}"
    ends = (f"sample {shown[0][0]}", f"{shown[-1][0]}") if len(shown) > 1 else (f"sample {shown[0][0]}",)
    return Figure(quantity.name, svg, caption, ends, (f"{top:g} {quantity.unit}", f"{top / 2:g}", "0"))
