"""Planning after each sample: the samples that are still needed for the required accuracy at a task.

Transforms and noise estimated from the samples so far replace the guesses. Samples that could not be taken, and samples
near them, are not tried again. Source: docs/mathematics.md (15.1), (15.2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.noise_summary import noise_summary
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.task_error import meeting_error
from basecal.acquisition.coverage import find_equal_sample
from basecal.cell import Calibration, Cell, Recording, RobotState, Sample
from basecal.errors import BasecalError, InputError
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import Array
from basecal.planning.plan import Offer, Plan, draw_offers, plan_for_task, plan_stations
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch, View

OFFERED_SAMPLES = 240
"""Number of candidates, drawn once: planning with them takes a fraction of a second while the arms wait."""

_FEWEST_SOLVED = 8  # samples: with fewer, the noise cannot be estimated
_SAME_M, _SAME_RAD = 2e-3, 2e-3  # distance below which a candidate repeats a sample that was taken
_NEAR_M, _NEAR_RAD = 0.03, 0.05  # distance to a failed sample: size of what hides a target or blocks an arm


@dataclass(frozen=True, eq=False)
class Replanner:
    """The requested accuracy, and the candidates to choose from.

    Attributes:
        cell: The cell.
        points_m: (n, 3) task points in the reference's base [m].
        tolerance_m: Largest accepted 95 % quantile of the error at the task [m].
        home: Initial states of the robots.
        offered: Candidates, by the names of the camera and the target.
    """

    cell: Cell
    points_m: Array
    tolerance_m: float
    home: Sample
    offered: Mapping[View, Sequence[Sample]]

    def plan(self, samples: Sequence[Sample], failed_samples: Sequence[Sample]) -> Plan:
        """Plan the remaining samples; none if a calibration of the samples so far meets the tolerance.

        Args:
            samples: Samples taken so far, with their observations.
            failed_samples: Samples that could not be taken.

        Raises:
            InputError: if no candidate is left.
        """
        task = _task_settings(self.points_m)
        plan = self._plan_from(_current_calibration(self.cell, samples, task), samples, failed_samples)
        if plan.samples or not plan.recorded:
            return plan
        calibration = calibrate(self.cell, Recording(tuple(samples)), task)
        return plan if calibration.meeting is None else self._plan_from(calibration, samples, failed_samples)

    def _plan_from(
        self, calibration: Calibration | None, samples: Sequence[Sample], failed_samples: Sequence[Sample]
    ) -> Plan:
        offered: list[Offer] = []
        for sketch in sketches(self.cell, calibration):
            remaining = [
                sample
                for sample in self.offered.get(sketch.view, ())
                if not _is_settled(sketch, sample, samples, failed_samples)
            ]
            offered += [(sketch, remaining)] if remaining else []
        if not offered:
            raise InputError("no candidate is left: teach another pose, and capture again")
        recording = _with_home(self.home, samples)
        return plan_for_task(self.cell, recording, calibration, self.points_m, self.tolerance_m, offers=offered)


def replanner(
    cell: Cell,
    samples: Sequence[Sample],
    home: Mapping[str, RobotState],
    points_m: Array,
    tolerance_m: float,
    plan_samples: Sequence[Sample] = (),
    seed: int = 0,
) -> Replanner:
    """Create a replanner with candidates near the current and the recorded robot states.

    Args:
        cell: The cell.
        samples: The recorded samples.
        home: Current states of the robots.
        points_m: (n, 3) task points in the reference's base [m].
        tolerance_m: Largest accepted 95 % quantile of the error at the task [m].
        plan_samples: Additional candidates for the first camera and target.
        seed: Seed of the random draws.

    Raises:
        InputError: if no candidate is feasible, or a transform has no guess.
    """
    at_home = Sample(0, robots=home)
    known = sketches(cell, _current_calibration(cell, samples, _task_settings(points_m)))
    drawn = draw_offers(known, _with_home(at_home, samples), OFFERED_SAMPLES, seed)
    offered = {sketch.view: list(offers) for sketch, offers in drawn}
    first = next(iter(offered))
    return Replanner(cell, points_m, tolerance_m, at_home, {**offered, first: [*offered[first], *plan_samples]})


def stations_for_task(
    cell: Cell,
    samples: Sequence[Sample],
    home: Mapping[str, RobotState],
    points_m: Array,
    tolerance_m: float | None,
    count: int | None,
    seed: int,
) -> Plan:
    """Plan the stations of programmed shifts, near current and recorded robot states, that lower the error the most.

    Args:
        cell: The cell.
        samples: The recorded samples.
        home: Current states of the robots.
        points_m: (n, 3) task points in the reference's base [m].
        tolerance_m: Largest accepted 95 % quantile of the error at the task [m]; None if `count` is given.
        count: Number of samples; None for as many as the tolerance needs.
        seed: Seed of the random draws.

    Raises:
        InputError: if no station is feasible, or a transform has no guess.
    """
    calibration = _current_calibration(cell, samples, _task_settings(points_m))
    recording = _with_home(Sample(0, robots=home), samples)
    return plan_stations(cell, recording, calibration, points_m, tolerance_m, count, seed)


def _with_home(home: Sample, samples: Sequence[Sample]) -> Recording:
    """Recording of the robots' initial states, followed by the recorded samples."""
    number = max((sample.sample for sample in samples), default=-1) + 1
    return Recording((replace(home, sample=number), *samples))


def _is_settled(sketch: Sketch, sample: Sample, samples: Sequence[Sample], failed_samples: Sequence[Sample]) -> bool:
    """Whether a candidate was taken already, or is near a sample that could not be taken."""
    near = ((samples, _SAME_M, _SAME_RAD), (failed_samples, _NEAR_M, _NEAR_RAD))
    return any(find_equal_sample(sketch, sample, others, m, rad) is not None for others, m, rad in near)


def _task_settings(points_m: Array) -> Settings:
    """Calibration settings for a task point, or for a task box given by its centre and corners, (n, 3) [m]."""
    centre, first, last = (tuple(points_m[k].tolist()) for k in (0, min(1, len(points_m) - 1), -1))
    return Settings(task_point=centre, task_box=None if len(points_m) == 1 else (*first, *last))


def _current_calibration(cell: Cell, samples: Sequence[Sample], task: Settings) -> Calibration | None:
    """Transforms, noise and the error at the task from the samples; None while any direction is unobservable."""
    if sum(bool(sample.observations) for sample in samples) < _FEWEST_SOLVED:
        return None
    recording = Recording(tuple(samples))
    try:
        solution = solve(cell, recording, Settings(robot_noise="estimated"))
    except BasecalError:
        return None
    if not solution.converged or solution.observability.unobservable:
        return None
    noise = noise_summary(cell, recording, solution)
    transforms, parameters = dict(solution.transforms), robot_parameters(solution)
    calibration = Calibration("doubtful", transforms, noise=noise, robot_parameters=parameters, settings=task.as_dict())
    return replace(calibration, meeting=meeting_error(calibration, ArmErrors(cell, solution, solution), task))
