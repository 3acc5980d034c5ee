"""Polar plots with rings: residuals by direction, and orientations of views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from basecal.accuracy.fit_details import ViewPoses
from basecal.accuracy.residuals.point_residuals import PointResiduals
from basecal.errors import count_text
from basecal.fields.digits import two_digits
from basecal.geometry import Array
from basecal.reporting.svg import Figure, dots, drawing, element, nice_ceiling, path, segments

RADIUS = 150.0
_MARGIN_PX = 16.0
MIDDLE = RADIUS + _MARGIN_PX
_MOST_DOTS = 1500  # more dots only overlap
_RANGE_RMS = 2.5  # radius over rms length: one in five hundred normal residuals is longer
_HALF, _MOST_OF = 50, 95  # percentiles of residuals in the caption
_MOST_VIEWS = 400  # views drawn
_RINGS_DEG = (30.0, 60.0, 90.0, 180.0)
_TICK = 6.0  # half the length of a mark on the drawing
_FEWEST_FOR_FACE = 0.5  # share of the views from the side of positive z, from which that is the target's front


def place_on_rings(xy: Array, top: float) -> Array:
    """Positions on the drawing, (n, 2), of vectors; length `top` is on the outermost ring, longer ones are clipped."""
    length = np.linalg.norm(xy, axis=-1, keepdims=True)
    shown: Array = MIDDLE + RADIUS * xy / np.maximum(length, top)
    return shown


def ring(kind: str, radius: float) -> Markup:
    """A circle about the centre of the plot."""
    return element("circle", class_=kind, cx=MIDDLE, cy=MIDDLE, r=radius)


def polar_drawing(label: str, rings: Sequence[tuple[float, str]], *inside: str) -> Markup:
    """A polar plot with labelled rings at shares of the radius, and elements on top."""
    circles = [ring("ring", share * RADIUS) for share, _ in rings]
    ends = f"M{MIDDLE - RADIUS:g} {MIDDLE:g}h{2 * RADIUS:g}M{MIDDLE:g} {MIDDLE - RADIUS:g}v{2 * RADIUS:g}"
    named = [
        element("text", name, class_="ring-label", x=MIDDLE + 3, y=MIDDLE - share * RADIUS - 3) for share, name in rings
    ]
    return drawing(2 * MIDDLE, 2 * MIDDLE, label, *circles, path("ring", ends), *inside, *named)


def residual_polar(points: PointResiduals) -> Figure:
    """Polar plot of residuals: a dot for each point of a camera, at its predicted minus its observed position.

    Args:
        points: Points of the camera, at least one used.
    """
    residuals, left_out = points.off_px[points.used], points.off_px[~points.used]
    length = np.linalg.norm(residuals, axis=-1)
    top = nice_ceiling(_RANGE_RMS * float(np.sqrt(np.mean(length**2))))
    shown = residuals[:: -(-len(residuals) // _MOST_DOTS)]
    drawn = {"cloud": shown, "left-out": left_out[:_MOST_DOTS]}
    clouds = [path(kind, dots(place_on_rings(each, top))) for kind, each in drawn.items()]
    rings = [(share, f"{share * top:.3g} px") for share in (0.5, 1.0)]
    svg = polar_drawing(f"reprojection errors of {points.camera} by direction", rings, *clouds)
    half, most = (two_digits(value) for value in np.percentile(length, [_HALF, _MOST_OF]))
    beyond = int(np.count_nonzero(length > top))
    outside = f" Longer, drawn on the outer ring: {count_text(beyond, 'residual')}." if beyond else ""
    also = f" Orange, left out: {count_text(len(left_out), 'point')}." if len(left_out) else ""
    few = f"{len(shown)} of {len(residuals)} points drawn. " if len(shown) < len(residuals) else ""
    caption = (
        f"{few}{_HALF} % are below {half} px, {_MOST_OF} % below {most} px.{outside}{also} A cloud that is not "
        "round and centred: a shared error."
    )
    return Figure(f"{points.camera}, residuals by direction", svg, caption)


def orientation_figure(views: ViewPoses) -> Figure:
    """Polar plot of views: radius is the tilt, angle the direction, and a line shows the camera's x axis.

    Args:
        views: Views of one camera and target, at least one.
    """
    shown = slice(None, None, -(-len(views.sample) // _MOST_VIEWS))
    target_from_camera = views.camera_from_target[shown].inverse()
    towards_camera = _units(target_from_camera.translation)
    face = 1.0 if np.mean(towards_camera[:, 2] > 0) >= _FEWEST_FOR_FACE else -1.0
    tilt = np.degrees(np.arccos(np.clip(face * towards_camera[:, 2], -1, 1)))
    top = next(each for each in _RINGS_DEG if tilt.max() <= each)
    positions = place_on_rings(_units(towards_camera[:, :2]) * tilt[:, None], top)
    directions = _TICK * _units(target_from_camera.rotation[:, :2, 0])
    marks = [
        element(
            "g",
            element("path", d=segments([(position - half, position + half)])),
            element("circle", cx=position[0], cy=position[1], r=3),
            title=f"sample {sample}: tilted by {angle:.0f} deg",
            class_="mark view",
            data_sample=sample,
        )
        for sample, angle, position, half in zip(views.sample[shown].tolist(), tilt, positions, directions, strict=True)
    ]
    rings = [(share / 3, f"{share / 3 * top:g}°") for share in (1, 2, 3)]
    label = f"directions that {views.camera} saw {views.target} from"
    svg = polar_drawing(label, rings, ring("centre", 1.5), *marks)
    caption = (
        "Middle: seen straight on; outwards: tilted. The line is the camera's x axis: a camera that never rotated "
        f"about its optical axis has parallel lines. Tilts of {tilt.min():.0f}° to {tilt.max():.0f}°."
    )
    return Figure(f"{views.target} seen by {views.camera}, from where", svg, caption)


def _units(vectors: Array) -> Array:
    """Vectors normalised to length one, (n, d); zero vectors are unchanged."""
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return units
