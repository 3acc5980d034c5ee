"""A scene for pages: data for the script that draws it, a still image without scripts, and a legend."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from basecal.cell import Calibration, Sample, Unknown
from basecal.fields.digits import two_digits
from basecal.planning.sketch import Sketch
from basecal.reporting.cell_view.picture import picture
from basecal.reporting.cell_view.scene import Scene, scene, scene_data
from basecal.reporting.svg import three_digits


def scene_values(scene: Scene) -> dict[str, Any]:
    """Values of a scene for the template; without samples there are no data for the script."""
    return {
        "drawn": scene,
        "scene_json": json_inside_html(scene_data(scene)) if scene.samples else "",
        "legend": _legend(scene),
        "picture": picture(scene),
    }


def stated_scene(sketch: Sketch, samples: Sequence[Sample]) -> Scene:
    """The scene of samples in a sketched cell, without a calibration."""
    cell = sketch.cell
    for name, mean in sketch.transforms.items():
        cell = cell.with_transform(name, Unknown("fixed", mean))
    return scene(cell, samples, Calibration("refused"))


def json_inside_html(data: Mapping[str, Any]) -> Markup:
    """JSON that cannot close its HTML element."""
    return Markup(json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def _legend(scene: Scene) -> list[str]:
    """Legend of the scene, with what is not drawn, in sentences."""
    sentences = ["Axes: x red, y green, z blue. Dots: flanges at each sample."]
    ellipsoids = [*(arm.ellipsoid for arm in scene.arms), *(body.ellipsoid for body in scene.bodies)]
    if any(each is not None for each in ellipsoids):
        scale = f", drawn {three_digits(scene.ellipsoid_scale)} times as large" if scene.ellipsoid_scale != 1 else ""
        sentences.append(f"Ellipsoid: 1 sigma of the position of requested transforms{scale}.")
    if scene.errors is not None:
        low, high = (two_digits(1e3 * float(end)) for end in np.quantile(scene.errors.length_95_m, [0, 1]))
        sentences.append(f"Cloud: 95 % of errors stay below {low} mm where it is pale and {high} mm where it is full.")
    if len(scene.samples) < scene.total:
        sentences.append(f"{len(scene.samples)} of {scene.total} samples are shown.")
    if scene.missing:
        sentences.append(f"Not drawn, as their poses are unknown: {', '.join(scene.missing)}.")
    return sentences
