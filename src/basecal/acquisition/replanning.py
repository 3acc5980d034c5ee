"""Planning after each sample: the samples that the required accuracy at a task still needs.

The samples taken are solved, and their transforms and noise replace the guesses. Samples that could not be taken, and
those near them, are not tried again. Source: docs/mathematics.md (15.1), (15.2).
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
"""Candidates, drawn once: planning among them takes a fraction of a second while the arms stand."""

_FEWEST_SOLVED = 8  # samples: of fewer, noise that is estimated says next to nothing
_SAME_M, _SAME_RAD = 2e-3, 2e-3  # of a sample that was taken
_NEAR_M, _NEAR_RAD = 0.03, 0.05  # of one that could not be: what hides a target or stops an arm is as large


@dataclass(frozen=True, eq=False)
class Replanner:
    """The requested accuracy, and the offers to choose from.

    Attributes:
        cell: The cell.
        points_m: (n, 3) the task in the reference's base [m].
        tolerance_m: The error that 95 of 100 there are to stay below [m].
        home: Where the robots are to begin with.
        offered: Samples that could be taken, by the camera and target that they show one another.
    """

    cell: Cell
    points_m: Array
    tolerance_m: float
    home: Sample
    offered: Mapping[View, Sequence[Sample]]

    def plan(self, samples: Sequence[Sample], bad: Sequence[Sample]) -> Plan:
        """The samples still to be taken, in order; none if a calibration of those taken meets the tolerance.

        Args:
            samples: What was, with what was seen.
            bad: What could not be.

        Raises:
            InputError: if nothing is left to choose from.
        """
        task = _task_settings(self.points_m)
        found = self._plan_from(_current_calibration(self.cell, samples, task), samples, bad)
        if found.samples or not found.recorded:
            return found
        made = calibrate(self.cell, Recording(tuple(samples)), task)
        return found if made.meeting is None else self._plan_from(made, samples, bad)

    def _plan_from(self, calibration: Calibration | None, samples: Sequence[Sample], bad: Sequence[Sample]) -> Plan:
        offered: list[Offer] = []
        for sketch in sketches(self.cell, calibration):
            left = [s for s in self.offered.get(sketch.view, ()) if not _is_settled(sketch, s, samples, bad)]
            offered += [(sketch, left)] if left else []
        if not offered:
            raise InputError("nothing is left to choose from: teach another pose, and capture again")
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
    """A replanner with candidates near where the robots are and were.

    Args:
        cell: The cell.
        samples: What was recorded already.
        home: Where the robots are.
        points_m: (n, 3) the task in the reference's base [m].
        tolerance_m: The error that 95 of 100 there are to stay below [m].
        plan_samples: Samples that are offered besides, of the first camera and target.
        seed: Of the draws.

    Raises:
        InputError: if there is no candidate, or a transform has no guess.
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
    seed: int = 0,
) -> Plan:
    """Whole stations of programmed shifts, near where the robots are and were, that lower the error at a task the most.

    Args:
        cell: The cell.
        samples: What was recorded already.
        home: Where the robots are.
        points_m: (n, 3) the task in the reference's base [m].
        tolerance_m: The error that 95 of 100 there are to stay below [m]; None if only `count` says how many.
        count: How many samples; as many as the tolerance needs where None.
        seed: Of the draws.

    Raises:
        InputError: if no station can be shifted from, or a transform has no guess.
    """
    calibration = _current_calibration(cell, samples, _task_settings(points_m))
    recording = _with_home(Sample(0, robots=home), samples)
    return plan_stations(cell, recording, calibration, points_m, tolerance_m, count, seed)


def _with_home(home: Sample, samples: Sequence[Sample]) -> Recording:
    """The recorded samples, after the robots' initial pose."""
    number = max((sample.sample for sample in samples), default=-1) + 1
    return Recording((replace(home, sample=number), *samples))


def _is_settled(sketch: Sketch, sample: Sample, samples: Sequence[Sample], bad: Sequence[Sample]) -> bool:
    """Whether a sample was taken, or is near one that could not be."""
    near = ((samples, _SAME_M, _SAME_RAD), (bad, _NEAR_M, _NEAR_RAD))
    return any(find_equal_sample(sketch, sample, others, m, rad) is not None for others, m, rad in near)


def _task_settings(points_m: Array) -> Settings:
    """Settings of a calibration for a point, or for a box whose middle and corners these are, (n, 3) [m]."""
    middle, first, last = (tuple(points_m[k].tolist()) for k in (0, min(1, len(points_m) - 1), -1))
    return Settings(task_point=middle, task_box=None if len(points_m) == 1 else (*first, *last))


def _current_calibration(cell: Cell, samples: Sequence[Sample], task: Settings) -> Calibration | None:
    """Transforms, noise and the error at the task by the samples; None while they leave any direction open."""
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
    found = Calibration("doubtful", transforms, noise=noise, robot_parameters=parameters, settings=task.as_dict())
    return replace(found, meeting=meeting_error(found, ArmErrors(cell, solution, solution), task))
