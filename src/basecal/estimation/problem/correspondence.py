"""Choose the correspondence of ambiguous views: a chessboard read from either end, an LED among several bright spots.

A detector sees one view at a time and cannot resolve the ambiguity; all views together can. Each view takes the reading
that fits the present state best, and the state is estimated again, until no reading changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Target
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, IntArray

MOST_CANDIDATES = 8  # bright spots that are tried per LED; assumed: bounds the time


def half_turn(target: Target) -> SE3 | None:
    """Transform `target_from_turned` of a target that looks the same rotated by 180 deg; None for other targets."""
    if not target.has_half_turn_symmetry:
        return None
    centre = target.points.mean(0)
    rotation = np.diag([-1.0, -1.0, 1.0])
    return SE3(rotation, centre - rotation @ centre)


def half_turn_views(measurement: PixelMeasurement) -> PixelMeasurement:
    """Views of a grid in reverse order of points: point k becomes point n - 1 - k."""
    return measurement.take_points(slice(None, None, -1))


def choose_correspondence(problem: Problem, state: State) -> tuple[Problem, bool]:
    """Return the problem with the reading of every view that fits the state best, and whether any reading changed.

    For a batch of states, the measurements get the batch axis, because each state has its own readings.
    """
    groups, changed = [], False
    for group in problem.groups:
        if len(group.readings) < 2:
            groups.append(group)
            continue
        predicted, camera = state.camera_from_target(group, problem.stops), state.cameras[group.camera]
        costs = np.stack([reading.linearise(predicted, camera, False).cost for reading in group.readings])
        best = np.asarray(np.argmin(costs, axis=0), dtype=np.int64)
        measurement = _select_readings(group.readings, best)
        assert isinstance(group.measurement, PixelMeasurement)
        changed |= bool(np.any(measurement.pixels != group.measurement.pixels))
        groups.append(replace(group, measurement=measurement))
    return (problem.with_groups(groups), True) if changed else (problem, False)


def _select_readings(readings: tuple[PixelMeasurement, ...], best: IntArray) -> PixelMeasurement:
    """Merge readings: view by view the reading of index `best`, ([b,] n)."""
    merged = readings[0]
    for k, reading in enumerate(readings[1:], start=1):
        is_best = (best == k)[..., None]
        relatives = None if merged.relative is None or reading.relative is None else (reading.relative, merged.relative)
        merged = replace(
            merged,
            pixels=np.where(is_best[..., None], reading.pixels, merged.pixels),
            seen=np.where(is_best, reading.seen, merged.seen),
            stated=np.where(is_best, reading.stated, merged.stated),
            weight=np.where(is_best, reading.weight, merged.weight),
            relative=None if relatives is None else np.where(is_best, *relatives),
        )
    return merged
