"""The directions that a camera saw a target from."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.residuals.view_poses import ViewPoses
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.rings import MIDDLE, place_on_rings, polar_drawing
from basecal.reporting.svg import element, text

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
    away = target_from_camera.translation
    away = away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12)
    face = 1.0 if np.mean(away[:, 2] > 0) >= _FEWEST_FOR_FACE else -1.0
    tilt = np.degrees(np.arccos(np.clip(face * away[:, 2], -1, 1)))
    top = next(ring for ring in _RINGS_DEG if tilt.max() <= ring)
    flat = away[:, :2] / np.maximum(np.linalg.norm(away[:, :2], axis=-1, keepdims=True), 1e-12)
    at = place_on_rings(flat * tilt[:, None], top)
    along = target_from_camera.rotation[:, :2, 0]
    along = _TICK * along / np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-12)
    marks = [
        element(
            "g",
            element("title", text(f"sample {sample}: tilted by {angle:.0f} deg")),
            element("path", d=f"M{x - dx:.1f} {y - dy:.1f}L{x + dx:.1f} {y + dy:.1f}"),
            element("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=3),
            class_="mark view",
            data_sample=sample,
        )
        for sample, angle, (x, y), (dx, dy) in zip(views.sample[shown].tolist(), tilt, at, along, strict=True)
    ]
    rings = [(ring / top, f"{ring:g}°") for ring in (top / 3, 2 * top / 3, top)]
    middle = element("circle", class_="centre", cx=f"{MIDDLE:g}", cy=f"{MIDDLE:g}", r=1.5)
    svg = polar_drawing(f"directions that {views.camera} saw {views.target} from", rings, middle, *marks)
    caption = (
        "Middle: seen straight on; outwards: tilted. The line is the camera's x axis: a camera that never turned about "
        f"its view has parallel lines. Tilts of {tilt.min():.0f}° to {tilt.max():.0f}°."
    )
    return Figure(f"{views.target} seen by {views.camera}, from where", svg, caption)
