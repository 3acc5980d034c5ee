"""Plans: the samples that a tolerance at the task needs, and the expected error with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from basecal.accuracy.task.budget import budget
from basecal.accuracy.task.expected_error import pooled_quantile
from basecal.accuracy.task.meeting import Meeting, make_meeting, meeting_places, worst_meeting
from basecal.accuracy.task.task import place_kind, require_placed_transforms, task_places
from basecal.cell import BudgetEntry, Calibration, Cell, MeetingError, Recording, RobotState, Sample, TouchObservation
from basecal.cell.work_error import PlaceKind
from basecal.errors import InputError, check_integer
from basecal.estimation.solve import Solution
from basecal.estimation.streams.streams import synchronous_recording
from basecal.geometry import Array
from basecal.geometry.array import read_only
from basecal.numerics.threads import limit_threads
from basecal.planning.candidates import candidates
from basecal.planning.choose import choose_fewest, exchange, greedy_choices
from basecal.planning.feasible import is_in_view
from basecal.planning.poses import order_samples
from basecal.planning.prospects import Prospects, prospects, sketches
from basecal.planning.shifts import STATION_SAMPLES, stations
from basecal.planning.sketch import Sketch

MOST_SAMPLES = 60
"""Largest plan: twice as many samples lower the error by a third at most, and take an hour of an arm's time."""

CANDIDATES = 600
"""Number of drawn candidates: with arm joints, the collision check of each takes some milliseconds."""

OUTLOOK_COUNTS = (0, 5, 10, 20, 40)
"""Numbers of additional samples for which the expected error is reported."""

OUTLOOK_CANDIDATES = 200
"""Number of drawn candidates for `outlook`."""

Offer = tuple[Sketch, Sequence[Sample]]
"""A sketch of a camera and a target, with samples in which the camera sees the target."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The samples to record.

    Attributes:
        samples: States of the robots, ordered for a short path; a sample of a touch names the tip and the mark.
        needed: Number of additional samples that the tolerance needs; None if it is not reached, or not stated.
        expected_m: 95 % quantile of the error at the task with the planned samples [m]. None if a direction is
            unobservable even then.
        reachable: Whether the tolerance can be reached; None if no tolerance is stated.
        recorded: Number of usable samples that are recorded already.
        budget: The error at the task with the planned samples, by source.
        marks: Positions at which marks are to be made, (3,) in the reference's base [m], by name.
        steps: (count, error [m]) with the first `count` samples, from 0; the most useful samples come first.
        place: Kind of the places at which the error is predicted.
    """

    samples: tuple[Sample, ...]
    needed: int | None
    expected_m: float | None
    reachable: bool | None
    recorded: int
    budget: tuple[BudgetEntry, ...]
    marks: Mapping[str, Array] = field(default_factory=dict)
    steps: tuple[tuple[int, float], ...] = ()
    place: PlaceKind = "recorded places"


@dataclass(frozen=True, eq=False)
class _Goal:
    """The tolerance at the task, and the error with the recorded samples.

    Attributes:
        meetings: The meeting of each base transform.
        tolerance_m: Largest accepted 95 % quantile of the error [m].
        recorded: Number of recorded samples.
        current_error: The error with the recorded samples according to their calibration; None without a calibration.
        unexplained_m2: Part of the variance of `current_error` that the noise in use does not explain [m^2].
    """

    meetings: tuple[Meeting, ...]
    tolerance_m: float
    recorded: int
    current_error: MeetingError | None
    unexplained_m2: float

    @cached_property
    def weight(self) -> Array:
        """Weight matrix of the criterion, (p, p)."""
        return np.asarray(sum(meeting.weight for meeting in self.meetings))

    def expected_m(self, covariance: Array, count: int) -> float:
        """95 % quantile of the error with a covariance of all columns, (p, p), and `count` additional samples [m].

        The contribution of unknown sigmas and of robot errors decreases as the number of samples increases.
        """
        if self.current_error is not None and count == 0:
            return self.current_error.expected_95_m
        errors_m = []
        for meeting in self.meetings:
            errors = meeting.total_covariance(covariance, meeting.stop_variances().values())[:, :3, :3]
            scale = np.sqrt(1 + self.excess_m2(count) / meeting.mean_square_m2(covariance))
            errors_m.append(scale * pooled_quantile(errors, np.zeros(errors.shape[:2])))
        return float(max(errors_m))

    def excess_m2(self, count: int) -> float:
        """Variance beyond the noise that remains with `count` additional samples [m^2]."""
        return self.unexplained_m2 * self.recorded / max(self.recorded + count, 1)


def _make_goal(
    prospect: Prospects, cell: Cell, calibration: Calibration | None, points_m: Array, tolerance_m: float | None = None
) -> _Goal:
    """The goal at points in the reference's base, (n, 3) [m]; at the recorded places for shape (0, 3).

    Raises:
        InputError: if there are neither points nor recorded samples.
    """
    problem, state, covariance = prospect.problem, prospect.state, prospect.covariance
    if not len(points_m) and not prospect.recorded:
        raise InputError("no sample shows where the arms work: name a task point: --task-point X Y Z [m]")
    recorded = prospect.recorded_problem
    places = {name: meeting_places(recorded, state, name, points_m) for name in require_placed_transforms(cell)}
    meetings = tuple(make_meeting(cell, problem, state, name, place) for name, place in places.items())
    current_error = None if calibration is None or not prospect.recorded else _calibrated_meeting(calibration, points_m)
    noise_m2 = worst_meeting(meetings, covariance).mean_square_m2(covariance)
    unexplained_m2 = 0.0 if current_error is None else max(current_error.variance_m2 - noise_m2, 0.0)
    return _Goal(
        meetings, np.inf if tolerance_m is None else tolerance_m, len(prospect.recorded), current_error, unexplained_m2
    )


def _calibrated_meeting(calibration: Calibration, points_m: Array) -> MeetingError | None:
    """The calibration's error at the task points, (n, 3) [m]; None if it was computed at other points."""
    settings = calibration.settings
    calibrated_points_m = task_places(settings.get("task_point"), settings.get("task_box"))
    return calibration.meeting if np.array_equal(calibrated_points_m, points_m) else None


@limit_threads
def plan_for_task(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: ArrayLike,
    tolerance_m: float | None = None,
    count: int | None = None,
    seed: int = 0,
    offers: Sequence[Offer] | None = None,
    group_size: int = 1,
) -> Plan:
    """Plan the samples to record for a task.

    Args:
        cell: The cell.
        recording: Samples with observations count as recorded; all samples serve as taught poses.
        calibration: Calibration of the recording; None to use the guesses of the cell.
        points_m: (n, 3) task points in the reference's base [m]; (0, 3) for the recorded places.
        tolerance_m: Largest accepted 95 % quantile of the error [m].
        count: Number of samples; None for as many as the tolerance needs.
        seed: Seed of the random draws.
        offers: Candidates to choose from; None to draw them near taught poses.
        group_size: Number of consecutive candidates that are taken together, such as the samples of a station.

    Raises:
        InputError: if an argument is invalid, the cell has no base to calibrate, no pose is taught, or a transform has
            no guess.
    """
    points_m = _checked_points(points_m, tolerance_m)
    for name, value, least in (("count", count or 0, 0), ("seed", seed, 0), ("group_size", group_size, 1)):
        check_integer(name, value, least)
    require_placed_transforms(cell)
    cell_sketches, recording = sketches(cell, calibration), synchronous_recording(cell, recording, calibration)
    if offers is not None and not offers:
        raise InputError("offers is empty, expected candidates or None")
    offers = draw_offers(cell_sketches, recording, CANDIDATES, seed) if offers is None else offers
    prospect = prospects(cell, recording, calibration, offers)
    roots = prospect.roots if group_size == 1 else prospect.group_roots(group_size)
    goal = _make_goal(prospect, cell, calibration, points_m, tolerance_m)
    chosen, reached = ([], None) if tolerance_m is None else _choose_for_tolerance(prospect, roots, goal, group_size)
    needed = group_size * len(chosen) if reached else None
    if count is not None and -(-count // group_size) != len(chosen):
        chosen, _ = choose_best(prospect, roots, goal.weight, -(-count // group_size))
    rows = [group_size * k + each for k in chosen for each in range(group_size)]
    solution = prospect.solution(rows)
    expected_m = _expected_error_m(solution, goal, len(rows))
    return Plan(
        _order_samples(cell_sketches[0], prospect, recording, rows, group_size == 1),
        needed,
        expected_m,
        reached,
        len(prospect.recorded),
        () if expected_m is None else _budget(solution, goal, len(rows)),
        steps=_steps(goal, prospect.covariance, roots[chosen], group_size),
        place=place_kind(points_m),
    )


def _checked_points(points_m: ArrayLike, tolerance_m: float | None) -> Array:
    """The validated points of a task, (n, 3) [m].

    Raises:
        InputError: if the points are not finite (n, 3), or the tolerance is not positive and finite.
    """
    points = read_only(points_m, (3,), "points_m")
    if points.ndim != 2 or not np.all(np.isfinite(points)):
        raise InputError(f"points_m has shape {points.shape}, expected finite (n, 3)")
    if tolerance_m is not None and not 0 < tolerance_m < np.inf:
        raise InputError(f"tolerance_m is {tolerance_m}, expected a length above zero [m]")
    return points


def _choose_for_tolerance(prospect: Prospects, roots: Array, goal: _Goal, group_size: int) -> tuple[list[int], bool]:
    """Fewest groups of samples that reach the tolerance, from their roots U, (n, p, q); and whether they reach it."""
    return choose_fewest(
        roots,
        prospect.covariance,
        goal.weight,
        MOST_SAMPLES // group_size,
        lambda covariance, groups: goal.expected_m(covariance, group_size * groups) <= goal.tolerance_m,
    )


def _steps(goal: _Goal, covariance: Array, roots: Array, group_size: int) -> tuple[tuple[int, float], ...]:
    """(count, error [m]) with 0, 1, 2 ... chosen groups, from their roots U, (n, p, q), and the prior covariance."""
    after = (each for _, each in greedy_choices(roots, covariance, goal.weight))
    counted = ((group_size * k, each) for k, each in enumerate([covariance, *after]))
    return tuple((count, goal.expected_m(each, count)) for count, each in counted)


def least_variance_m2(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: Array,
    count: int,
    offers: Sequence[Offer],
) -> float:
    """Mean square error at the task with the recorded samples and the best `count` offered samples [m^2]."""
    prospect = prospects(cell, recording, calibration, offers)
    goal = _make_goal(prospect, cell, calibration, points_m)
    _, covariance = choose_best(prospect, prospect.roots, goal.weight, count)
    return float(np.trace(goal.weight @ covariance))


def outlook(
    cell: Cell, recording: Recording, calibration: Calibration, points_m: Array
) -> tuple[tuple[int, float], ...]:
    """Expected error with additional samples: pairs of their number and the 95 % quantile of the error [m].

    Args:
        cell: The cell.
        recording: The recording; samples with observations count as recorded.
        calibration: Calibration of the recording.
        points_m: (n, 3) task points in the reference's base [m]; (0, 3) for the recorded places.

    Raises:
        InputError: if the cell has no base to calibrate, no pose is taught, or no candidate is feasible.
    """
    cell_sketches = sketches(cell, calibration)
    recording = synchronous_recording(cell, recording, calibration)
    prospect = prospects(cell, recording, calibration, draw_offers(cell_sketches, recording, OUTLOOK_CANDIDATES))
    goal = _make_goal(prospect, cell, calibration, points_m)
    steps = greedy_choices(prospect.roots, prospect.covariance, goal.weight)
    covariances = [prospect.covariance, *(after for _, after in islice(steps, OUTLOOK_COUNTS[-1]))]
    return tuple(
        (count, goal.expected_m(covariances[count], count)) for count in OUTLOOK_COUNTS if count < len(covariances)
    )


def choose_best(prospect: Prospects, roots: Array, weight: Array, count: int) -> tuple[list[int], Array]:
    """Choose `count` candidates greedily with exchange; their indices, and the covariance with them, (p, p)."""
    chosen, covariance = list[int](), prospect.covariance
    for best, covariance in islice(greedy_choices(roots, prospect.covariance, weight), count):  # noqa: B007
        chosen.append(best)
    return exchange(roots, chosen, covariance, weight)


def draw_offers(cell_sketches: Sequence[Sketch], recording: Recording, count: int, seed: int = 0) -> list[Offer]:
    """Draw candidates for each camera and target that were observed together, or would be at a taught pose.

    Args:
        cell_sketches: A sketch of the cell for each camera and target.
        recording: The taught poses.
        count: Total number of candidates.
        seed: Seed of the random draws.

    Raises:
        InputError: if no pose is taught, or no candidate is feasible.
    """
    observed = {(o.camera, o.target) for sample in recording.samples for o in sample.observations}
    taught = {sketch.view: _teaching_samples(sketch, recording) for sketch in cell_sketches}
    cell_sketches = [sketch for sketch in cell_sketches if taught[sketch.view]]
    if not cell_sketches:
        raise InputError(
            "a plan needs taught poses: jog the arms so that the target is in the middle of the image. Record "
            "that once or more, by basecal capture or by lines with `robots` alone in recording/samples.jsonl"
        )
    shown = [
        each for each in cell_sketches if each.view in observed or any(is_in_view(each, s) for s in taught[each.view])
    ]
    shown = shown or [cell_sketches[0]]
    offers, problem = list[Offer](), None
    for sketch in shown:
        try:
            states = _taught_states(sketch, taught[sketch.view])
            offers.append((sketch, candidates(sketch, states, -(-count // len(shown)), seed)))
        except InputError as error:
            problem = error
    if problem is not None and not offers:
        raise problem
    return offers


def plan_stations(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: ArrayLike,
    tolerance_m: float | None = None,
    count: int | None = None,
    seed: int = 0,
) -> Plan:
    """Plan whole stations of programmed shifts for a task; arguments as in `plan_for_task`.

    The stations use the first camera and target that were observed together, or would be at a taught pose.

    Raises:
        InputError: if no pose is taught, or no station can be shifted from.
    """
    cell_sketches = sketches(cell, calibration)
    (sketch, _), *_ = draw_offers(cell_sketches, recording, 1, seed)
    offers = [(sketch, stations(sketch, _taught_states(sketch, _teaching_samples(sketch, recording)), seed))]
    return plan_for_task(
        cell, recording, calibration, points_m, tolerance_m, count, seed, offers=offers, group_size=STATION_SAMPLES
    )


def _teaching_samples(sketch: Sketch, recording: Recording) -> list[Sample]:
    """Samples that contain the states of all robots that carry the camera or the target."""
    return [sample for sample in recording.samples if set(sketch.movers) <= sample.robots.keys()]


def _taught_states(sketch: Sketch, samples: Sequence[Sample]) -> list[dict[str, RobotState]]:
    """Robot states at which the camera observed the target; else at which it would; else of all samples."""
    observed = [s for s in samples if any((o.camera, o.target) == sketch.view for o in s.observations)]
    observed = observed or [s for s in samples if is_in_view(sketch, s)]
    return [dict(sample.robots) for sample in observed or samples]


def _order_samples(
    sketch: Sketch, prospect: Prospects, recording: Recording, choice: Sequence[int], may_reorder: bool
) -> tuple[Sample, ...]:
    """The chosen samples, on a short path if they may be reordered and move all arms; else in the offered order."""
    if not choice:
        return ()
    samples, first = [prospect.samples[k] for k in choice], prospect.samples[0].sample
    if may_reorder and all(set(sketch.cell.robots) <= sample.robots.keys() for sample in samples):
        home = next(s.robots for s in reversed(recording.samples) if set(sketch.cell.robots) <= s.robots.keys())
        samples = order_samples(sketch, home, samples)
    elif may_reorder:
        samples.sort(key=lambda sample: sample.sample)
    return tuple(_without_images(first + k, sample) for k, sample in enumerate(samples))


def _without_images(number: int, sample: Sample) -> Sample:
    """A sample with its touches, and without the predicted observations of cameras."""
    touches = tuple(observation for observation in sample.observations if isinstance(observation, TouchObservation))
    return Sample(number, robots=sample.robots, observations=touches)


def _expected_error_m(solution: Solution, goal: _Goal, count: int) -> float | None:
    if solution.observability.unobservable & {meeting.transform for meeting in goal.meetings}:
        return None
    return goal.expected_m(solution.covariance, count)


def _budget(solution: Solution, goal: _Goal, count: int) -> tuple[BudgetEntry, ...]:
    meeting = worst_meeting(goal.meetings, solution.covariance)
    total_m2 = meeting.mean_square_m2(solution.covariance)
    return budget(solution, meeting, total_m2 + goal.excess_m2(count), {})
