"""The directions that a camera saw a target from."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.fit_details import ViewPoses
from basecal.geometry import Array
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.rings import place_on_rings, polar_drawing, ring
from basecal.reporting.svg import element, segments

_MOST_VIEWS = 400  # views drawn
_RINGS_DEG = (30.0, 60.0, 90.0, 180.0)
_TICK = 6.0  # half the length of a mark on the drawing
_FEWEST_FOR_FACE = 0.5  # share of the views from one side, which then is the target's face


def orientation_figure(views: ViewPoses) -> Figure:
    """A mark for each view: from the middle outwards the tilt, around it the direction, turned as the camera was.

    Args:
        views: Of one camera and target, at least one.
    """
    shown = slice(None, None, -(-len(views.sample) // _MOST_VIEWS))
    target_from_camera = views.camera_from_target[shown].inverse()
    away = _units(target_from_camera.translation)
    face = 1.0 if np.mean(away[:, 2] > 0) >= _FEWEST_FOR_FACE else -1.0
    tilt = np.degrees(np.arccos(np.clip(face * away[:, 2], -1, 1)))
    top = next(each for each in _RINGS_DEG if tilt.max() <= each)
    at = place_on_rings(_units(away[:, :2]) * tilt[:, None], top)
    along = _TICK * _units(target_from_camera.rotation[:, :2, 0])
    marks = [
        element(
            "g",
            element("path", d=segments([(place - half, place + half)])),
            element("circle", cx=place[0], cy=place[1], r=3),
            title=f"sample {sample}: tilted by {angle:.0f} deg",
            class_="mark view",
            data_sample=sample,
        )
        for sample, angle, place, half in zip(views.sample[shown].tolist(), tilt, at, along, strict=True)
    ]
    rings = [(share / 3, f"{share / 3 * top:g}°") for share in (1, 2, 3)]
    label = f"directions that {views.camera} saw {views.target} from"
    svg = polar_drawing(label, rings, ring("centre", 1.5), *marks)
    caption = (
        "Middle: seen straight on; outwards: tilted. The line is the camera's x axis: a camera that never turned about "
        f"its view has parallel lines. Tilts of {tilt.min():.0f}° to {tilt.max():.0f}°."
    )
    return Figure(f"{views.target} seen by {views.camera}, from where", svg, caption)


def _units(vectors: Array) -> Array:
    """Vectors of length one, (n, d), along others; those of no length stay."""
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return units
