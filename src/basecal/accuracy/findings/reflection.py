"""`reflection`: bright spots near an LED, which all views together distinguish from it.

`benchmarks.capture_images` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.estimation.noise.shaped_targets import shaped_points
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array, BoolArray

_LEAST_DISTANCE_PX = 1.0  # [px] distance between two spots, below which they are one
_UNCLEAR_PX = 3.0  # [px] distance of another spot from the predicted LED, below which it could be the LED
_MANY_SHARE = 0.1  # share of ambiguous images above which the answer may depend on wrong spots


def reflection(evidence: Evidence) -> list[Finding]:
    """A finding about each LED with other bright spots; a warning if more than one image in ten is ambiguous."""
    found = []
    for group in evidence.solution.problem.groups:
        spots = _recorded_spots(group, evidence.recorded)
        if spots is None or len(shaped_points(group)) != 1:
            continue
        others, unclear = _spot_masks(group, spots, evidence)
        if not others.any():
            continue
        count, total = int(others.sum()), len(others)
        numbers = tuple(map(str, group.sample[others].tolist()))
        what = f"{group.camera} sees other bright spots beside {group.target} in {count} of {total} images."
        why = "They are reflections or other lights; the geometry of all images together separates them."
        is_grave = bool(unclear.mean() > _MANY_SHARE)
        if is_grave:
            why += f" In {int(unclear.sum())} images both are near the predicted position."
        do = ("Cover shiny parts, or switch the LED and take images with and without it.",)
        found.append(Finding("reflection", "warning" if is_grave else "info", numbers, what, do, why))
    return found


def _recorded_spots(group: ViewGroup, problem: Problem) -> Array | None:
    """First point of each alternative reading of a group's views, (k, n, 2) [px]; None if there is one reading."""
    for each in problem.groups:
        if (each.camera, each.target) == (group.camera, group.target) and len(each.readings) > 1:
            row = {number: k for k, number in enumerate(each.sample.tolist())}
            rows = [row[number] for number in group.sample.tolist()]
            return np.stack([reading.pixels[rows, 0] for reading in each.readings])
    return None


def _spot_masks(group: ViewGroup, spots: Array, evidence: Evidence) -> tuple[BoolArray, BoolArray]:
    """Whether each view has a spot besides the used one, and whether one is near the predicted LED, (n,) each."""
    assert isinstance(group.measurement, PixelMeasurement)
    used, state = group.measurement.pixels[:, 0], evidence.solution.state
    camera_from_target = state.camera_from_target(group, evidence.solution.problem.stops)
    point = camera_from_target @ group.measurement.points_in_target[0]
    predicted = state.cameras[group.camera].project(point)
    is_other = np.linalg.norm(spots - used, axis=-1) > _LEAST_DISTANCE_PX
    is_near = np.linalg.norm(spots - predicted, axis=-1) < _UNCLEAR_PX
    return is_other.any(axis=0), (is_other & is_near).any(axis=0)
