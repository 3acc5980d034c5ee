"""The paper's closed form beside another answer from the same recording: each station's base, and that of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.accuracy.axis_shift import calibrate_axis_shift, choose_base, find_pair_stations
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import NotObservable
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, PoseEstimate


def difference(pose: SE3, reference: SE3) -> Array:
    """A transform against another, (6,) along and about the axes of what that other places [m, rad]."""
    return np.asarray((pose.inverse() @ reference).log())


@dataclass(frozen=True, eq=False)
class StationBeside:
    """The answer of one station.

    Attributes:
        samples: Their numbers; the first is where its shifts start from.
        light: (3,) where the light was, in the base of the robot that looks [m].
        off: (6,) its base against the other answer, along and about the axes of that [m, rad].
        weight: Its share of the closed form's answer.
    """

    samples: tuple[int, ...]
    light: Array
    off: Array
    weight: float


@dataclass(frozen=True, eq=False)
class ClosedFormComparison:
    """The closed form beside another answer.

    Attributes:
        name: The transform.
        estimate: By the closed form.
        other: By the other.
        stations: What each says.
    """

    name: str
    estimate: PoseEstimate
    other: PoseEstimate
    stations: tuple[StationBeside, ...]

    @property
    def difference(self) -> Array:
        """(6,) the closed form against the other answer, as of a station."""
        return difference(self.other.mean, self.estimate.mean)


def compare_closed_form(cell: Cell, recording: Recording, calibration: Calibration) -> ClosedFormComparison | None:
    """The closed form beside a calibration; None if it is one itself, or the recording has no programmed shifts.

    Args:
        cell: What was calibrated.
        recording: What was seen.
        calibration: What came out.
    """
    if calibration.settings.get("method") == "axis-shift":
        return None
    task = calibration.settings.get("task_point")
    settings = Settings(method="axis-shift", task_point=None if task is None else tuple(task))
    problem, _ = build_problem(cell, recording)
    try:
        closed = calibrate_axis_shift(cell, problem, settings, [])
        stations = find_pair_stations(problem, cell)
    except NotObservable:
        return None
    name, estimate = next(iter(closed.transforms.items()))
    other = calibration.transforms.get(name)
    if other is None:
        return None
    _, weights = choose_base(stations, settings)
    inverted = problem.groups[0].hand.robot == cell.reference
    said = []
    for station, weight in zip(stations, weights, strict=True):
        base = station.base()
        light = (base @ station.hand_base_from_light).translation
        off = difference(other.mean, base.inverse() if inverted else base)
        said.append(StationBeside(tuple(int(n) for n in station.samples), light, off, float(weight)))
    return ClosedFormComparison(name, estimate, other, tuple(said))
