"""Calibrate with the paper's closed form: the base from every station, one base for the task, and its covariance.

The closed form is also compared with other calibrations of the same recording, station by station.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.cell import Calibration, Cell, Finding, Recording
from basecal.errors import NotObservable
from basecal.estimation.axis_shift.stations import Station, find_stations, fuse_bases, task_weights
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.start.first_state import lenses
from basecal.fields.digits import two_digits
from basecal.geometry import SE3, Array, PoseEstimate

# [px] noise of an LED's centre if it is not stated: that of a plain centroid; assumed, and reported as such.
_ASSUMED_PX = 0.3
_STEP_PX = 1e-3  # [px] step of the central difference, whose error is proportional to its square
_SYSTEMATIC_SIGMAS = 2.0  # sigmas of the noise above which the neglected depth gives a warning


def find_pair_stations(problem: Problem, cell: Cell) -> list[Station]:
    """Find the stations of a recording; all lenses must be known.

    Raises:
        NotObservable: if there is no station, or a lens or a mount is not known.
    """
    unknown = [name for name, lens in problem.lenses.items() if lens.camera is None]
    if unknown:
        raise NotObservable(f"the axis-shift method needs the lens of {unknown[0]}: state its intrinsics")
    return find_stations(problem, lenses(problem, cell))


def calibrate_axis_shift(cell: Cell, problem: Problem, settings: Settings, findings: list[Finding]) -> Calibration:
    """Calibrate a base with the paper's closed form.

    Its covariance has two parts: the pixels' noise to first order, and the square of the neglected change of depth. The
    latter follows from the closed form applied to the pixels that its own answer predicts.

    Raises:
        NotObservable: if there is no station, a mount or lens is not known, or several bases are requested.
    """
    names = [name for name in cell.requested_transforms if name in {cell.base_name(r) for r in cell.robots}]
    if len(names) != 1:
        raise NotObservable("the axis-shift method finds the base of one robot from another's camera: ask for one base")
    stations = find_pair_stations(problem, cell)
    sigma = cell.pixel_px or _ASSUMED_PX
    base, weights = combine_stations(stations, settings)
    random, systematic = _errors(stations, weights, sigma)
    found = [*findings, *_station_findings(stations)]
    if cell.pixel_px is None:
        what = f"noise.pixel_px is not stated; {_ASSUMED_PX} px are assumed for the covariance."
        found.append(Finding("axis-shift-station", "info", (), what, ("State noise.pixel_px in cell.yaml.",)))
    found += _depth_findings(random, systematic)
    covariance = random + np.outer(systematic, systematic)
    inverted = problem.groups[0].hand.robot == cell.reference
    estimate = PoseEstimate(base, covariance)
    return Calibration(
        verdict="doubtful" if any(f.severity == "warning" for f in found) else "good",
        transforms={names[0]: estimate.inverse() if inverted else estimate},
        status={names[0]: "free"},
        noise={"pixel_px": sigma, "robots": {}},
        order=(names[0],),
        joint_covariance=(estimate.inverse() if inverted else estimate).covariance,
        findings=tuple(found),
        settings=settings.as_dict(),
    )


def combine_stations(stations: Sequence[Station], settings: Settings) -> tuple[SE3, Array]:
    """Combine the bases of stations into the base for the task; return it with the stations' weights, (n,)."""
    if settings.task_point is None:
        depth = np.array([np.linalg.norm(s.camera_from_led().translation) for s in stations])
        weights = (np.array([s.rms_shift_m for s in stations]) / depth) ** 2
    else:
        weights = task_weights(stations, np.array(settings.task_point), settings.station_choice == "nearest")
    return fuse_bases([s.base() for s in stations], weights), weights / weights.sum()


def _errors(stations: Sequence[Station], weights: Array, sigma_px: float) -> tuple[Array, Array]:
    """Covariance from the pixel noise, (6, 6), and systematic error from the neglected depth, (6,) [m, rad]."""
    random, systematic = np.zeros((6, 6)), np.zeros(6)
    for station, weight in zip(stations, weights, strict=True):
        base = station.base()
        # Derivative of the base's right tangent with respect to the image coordinates, (6, 2 n).
        count = station.led_px.size
        nudges = _STEP_PX * np.eye(count).reshape(count, *station.led_px.shape)
        ahead, behind = station.base(station.led_px + nudges), station.base(station.led_px - nudges)
        steps = [(base.inverse() @ side).log() for side in (ahead, behind)]
        jacobian = ((steps[0] - steps[1]) / (2 * _STEP_PX)).T
        random += (weight * sigma_px) ** 2 * jacobian @ jacobian.T
        systematic += weight * (base.inverse() @ station.base(station.predicted_px(base))).log()
    return random, systematic


def _station_findings(stations: Sequence[Station]) -> list[Finding]:
    found = []
    for station in stations:
        base = station.base()
        led = (base @ station.hand_base_from_led).translation
        led_mm, base_mm = (", ".join(f"{1e3 * v:.1f}" for v in p) for p in (led, base.translation))
        numbers = tuple(str(int(n)) for n in station.samples)
        what = f"Station at samples {', '.join(numbers)}: LED at ({led_mm}) mm, base at ({base_mm}) mm."
        found.append(Finding("axis-shift-station", "info", numbers, what))
    return found


def _depth_findings(random: Array, systematic: Array) -> list[Finding]:
    sigma = np.sqrt(np.diag(random))
    if np.all(np.abs(systematic) <= _SYSTEMATIC_SIGMAS * sigma):
        return []
    shift, turn = 1e3 * float(np.linalg.norm(systematic[:3])), np.degrees(np.linalg.norm(systematic[3:]))
    what = f"The closed form moves the base by about {two_digits(shift)} mm and {two_digits(turn)} deg."
    why = "It neglects how the shifts change the LED's depth."
    do = ("Use shorter shifts, shifts to both sides, or the general solver.",)
    return [Finding("neglected-depth", "warning", (), what, do, why)]


def difference(pose: SE3, reference: SE3) -> Array:
    """Step from `pose` to `reference` in the frame that `pose` places, (6,) [m, rad]."""
    return (pose.inverse() @ reference).log()


@dataclass(frozen=True, eq=False)
class StationAnswer:
    """The answer of one station.

    Attributes:
        samples: Sample numbers; the programmed shifts start at the first.
        light: Position of the LED in the base of the robot with the camera, (3,) [m].
        difference: Step from the base of the other calibration to that of the station, in the frame of the former, (6,)
            [m, rad].
        weight: Weight of the station in the closed form's answer; the sum over stations is 1.
    """

    samples: tuple[int, ...]
    led: Array
    difference: Array
    weight: float


@dataclass(frozen=True, eq=False)
class ClosedFormComparison:
    """The closed form compared with another calibration.

    Attributes:
        name: Name of the transform.
        estimate: Estimate of the closed form.
        other: Estimate of the other calibration.
        stations: Answer of each station.
    """

    name: str
    estimate: PoseEstimate
    other: PoseEstimate
    stations: tuple[StationAnswer, ...]

    @property
    def difference(self) -> Array:
        """Step from the other calibration to the closed form, in the frame of the former, (6,) [m, rad]."""
        return difference(self.other.mean, self.estimate.mean)


def compare_closed_form(cell: Cell, recording: Recording, calibration: Calibration) -> ClosedFormComparison | None:
    """Compare the closed form with a calibration.

    Args:
        cell: The cell.
        recording: The recording.
        calibration: The calibration from both.

    Returns:
        None if the calibration is of the closed form itself, or the recording has no programmed shifts.
    """
    if calibration.settings.get("method") == "axis-shift":
        return None
    task = calibration.settings.get("task_point")
    settings = Settings(method="axis-shift", task_point=None if task is None else tuple(task))
    problem, _ = build_problem(cell, recording)
    try:
        closed_form = calibrate_axis_shift(cell, problem, settings, [])
        stations = find_pair_stations(problem, cell)
    except NotObservable:
        return None
    name, estimate = next(iter(closed_form.transforms.items()))
    other = calibration.transforms.get(name)
    if other is None:
        return None
    _, weights = combine_stations(stations, settings)
    inverted = problem.groups[0].hand.robot == cell.reference
    answers = []
    for station, weight in zip(stations, weights, strict=True):
        base = station.base()
        led = (base @ station.hand_base_from_led).translation
        step = difference(other.mean, base.inverse() if inverted else base)
        answers.append(StationAnswer(tuple(int(n) for n in station.samples), led, step, float(weight)))
    return ClosedFormComparison(name, estimate, other, tuple(answers))
