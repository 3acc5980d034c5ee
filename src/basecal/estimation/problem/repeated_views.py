"""Views that a recording holds twice, such as rows that were copied: noise does not repeat itself to the last bit."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from basecal.cell import Finding, Observation, PixelObservation, PointObservation, PoseObservation, TouchObservation
from basecal.geometry import Array

_LISTED_SAMPLES = 10  # samples that a message names; assumed to fit it


def view_content(observation: Observation, stops: Sequence[int]) -> Hashable:
    """Content of a view, and the stops of the robots that carry camera and target: equal for copies."""
    if isinstance(observation, PoseObservation):
        arrays: list[Array] = [observation.camera_from_target.rotation, observation.camera_from_target.translation]
    elif isinstance(observation, TouchObservation):
        arrays = []
    elif isinstance(observation, PointObservation):
        arrays = [observation.points_in_camera, observation.ids.astype(np.float64)]
    else:
        ids = observation.ids if isinstance(observation, PixelObservation) else np.zeros(0)
        arrays = [observation.pixels, ids.astype(np.float64)]
    return observation.camera, observation.target, *stops, *map(np.ndarray.tobytes, arrays)


def repeated_views(numbers: Sequence[int]) -> list[Finding]:
    """A finding about the samples, by number, whose views are counted with earlier ones; none without any."""
    if not numbers:
        return []
    shown = ", ".join(map(str, numbers[:_LISTED_SAMPLES])) + (", ..." if len(numbers) > _LISTED_SAMPLES else "")
    one = len(numbers) == 1
    which = f"The view of sample {shown} repeats" if one else f"{len(numbers)} views, of sample {shown}, repeat"
    what = f"{which} that of an earlier sample to the last bit."
    why = f"No camera does that; {'it' if one else 'each'} counts once."
    do = ("Look for rows that were copied, and remove them.",)
    return [Finding("duplicate-samples", "info", tuple(map(str, numbers)), what, do, why)]
