"""A plan: the samples that a tolerance at the task needs, or why no samples reach it."""

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
from basecal.accuracy.task.task import base_transforms, place_kind, task_places
from basecal.cell import BudgetEntry, Calibration, Cell, MeetingError, Recording, RobotState, Sample, TouchObservation
from basecal.cell.work_error import PlaceKind
from basecal.errors import InputError, check_integer
from basecal.estimation.solve import Solution
from basecal.estimation.streams.streams import synchronous
from basecal.geometry import Array
from basecal.geometry.array import read_only
from basecal.numerics.threads import limit_threads
from basecal.planning.candidates import candidates
from basecal.planning.choose import choose_fewest, exchange, greedy
from basecal.planning.feasible import is_in_view
from basecal.planning.poses import order_samples
from basecal.planning.prospects import Prospects, prospects, sketches
from basecal.planning.shifts import STATION_SAMPLES, stations
from basecal.planning.sketch import Sketch

MOST_SAMPLES = 60
"""Of a plan: with twice as many the error falls by a third at most, and an hour of an arm's time is gone."""

CANDIDATES = 600
"""Drawn to choose from: of arms with joints each takes some milliseconds to be found free of collision."""

OUTLOOK_COUNTS = (0, 5, 10, 20, 40)
"""Samples more, of which it is reported what they bring."""

OUTLOOK_CANDIDATES = 200

Offer = tuple[Sketch, Sequence[Sample]]
"""A camera and target, with samples that show one the other."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The samples to record.

    Attributes:
        samples: Where the robots shall be, in an order that makes their way short; touches say of what.
        needed: How many samples the tolerance needs beside those recorded; None if it is not reached, or not stated.
        expected_m: The distance that 95 of 100 errors at the task stay below, with the samples taken [m]. None if a
            direction is open even then.
        reachable: Whether the tolerance is; None if none is stated.
        recorded: How many samples are recorded already and count.
        budget: The error at the task by source, with the samples taken.
        marks: Where marks are to be made, (3,) in the reference's base, by name.
        steps: (count, error [m]) with so many of the samples, those first that lower it the most; none comes first.
        place: At which places the error is expected.
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
    """Where all that is placed meets, the tolerance, and what is known with the samples that were recorded.

    Attributes:
        meetings: Of each transform.
        tolerance_m: The error that 95 of 100 are to stay below [m].
        recorded: How many samples were.
        now: The error with these, as a calibration has it; None if none was made of them.
        beyond_m2: What of its variance the covariance of the noise in use does not hold [m^2].
    """

    meetings: tuple[Meeting, ...]
    tolerance_m: float
    recorded: int
    now: MeetingError | None
    beyond_m2: float

    @cached_property
    def weight(self) -> Array:
        """The criterion's weight of all columns, (p, p)."""
        return np.asarray(sum(meeting.weight for meeting in self.meetings))

    def expected_m(self, covariance: Array, count: int) -> float:
        """The error with this covariance of all columns, (p, p), of what was recorded and so many samples more [m].

        What sigmas that are not known, and errors of arms, add to it falls as the samples grow in number.
        """
        if self.now is not None and count == 0:
            return self.now.expected_95_m
        found = []
        for meeting in self.meetings:
            at = meeting.total_error(covariance, meeting.stop_variances().values())[:, :3, :3]
            scale = np.sqrt(1 + self.excess_m2(count) / meeting.mean_square_m2(covariance))
            found.append(scale * pooled_quantile(at, np.zeros(at.shape[:2])))
        return float(max(found))

    def excess_m2(self, count: int) -> float:
        """Variance beyond the noise that is left with so many samples more [m^2]."""
        return self.beyond_m2 * self.recorded / max(self.recorded + count, 1)


def _make_goal(
    prospect: Prospects, cell: Cell, calibration: Calibration | None, points_m: Array, tolerance_m: float | None = None
) -> _Goal:
    """The goal at points in the reference's base, (n, 3) [m], or at recorded places if there are none.

    Raises:
        InputError: if there are none, and nothing was recorded.
    """
    problem, state, covariance = prospect.problem, prospect.state, prospect.covariance
    if not len(points_m) and not prospect.recorded:
        raise InputError("no sample shows where the arms work: name a task point: --task-point X Y Z [m]")
    recorded = prospect.recorded_problem
    places = {name: meeting_places(recorded, state, name, points_m) for name in base_transforms(cell)}
    meetings = tuple(make_meeting(cell, problem, state, name, at) for name, at in places.items())
    now = None if calibration is None or not prospect.recorded else _calibrated_meeting(calibration, points_m)
    by_noise_m2 = worst_meeting(meetings, covariance).mean_square_m2(covariance)
    beyond_m2 = 0.0 if now is None else max(now.variance_m2 - by_noise_m2, 0.0)
    return _Goal(meetings, np.inf if tolerance_m is None else tolerance_m, len(prospect.recorded), now, beyond_m2)


def _calibrated_meeting(calibration: Calibration, points_m: Array) -> MeetingError | None:
    """The error at these points, (n, 3), as the calibration has it; None if it is that at others."""
    settings = calibration.settings
    its_points_m = task_places(settings.get("task_point"), settings.get("task_box"))
    return calibration.meeting if np.array_equal(its_points_m, points_m) else None


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
    """The samples to record for a task.

    Args:
        cell: The cell.
        recording: Samples with observations count as recorded; all show where the arms may stand.
        calibration: Of them; None if nothing is calibrated, and the cell's own guesses are taken.
        points_m: (n, 3) the task in the reference's base [m]; (0, 3) is where the arms worked.
        tolerance_m: The error that 95 of 100 are to stay below [m].
        count: How many samples; as many as the tolerance needs where None.
        seed: Of the draws.
        offers: What there is to choose from; drawn near taught poses where None.
        group_size: How many of these, one after another, are taken together, such as those of a station.

    Raises:
        InputError: if an argument is not as expected, nothing is placed for the task, no pose is taught, or a transform
            has no guess.
    """
    points_m = _checked_points(points_m, tolerance_m)
    for name, value, least in (("count", count or 0, 0), ("seed", seed, 0), ("group_size", group_size, 1)):
        check_integer(name, value, least)
    base_transforms(cell)
    known, recording = sketches(cell, calibration), synchronous(cell, recording, calibration)
    if offers is not None and not offers:
        raise InputError("offers is empty, expected what there is to choose from, or None")
    offered = draw_offers(known, recording, CANDIDATES, seed) if offers is None else offers
    prospect = prospects(cell, recording, calibration, offered)
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
        _order_samples(known[0], prospect, recording, rows, group_size == 1),
        needed,
        expected_m,
        reached,
        len(prospect.recorded),
        () if expected_m is None else _budget(solution, goal, len(rows)),
        steps=_steps(goal, prospect.covariance, roots[chosen], group_size),
        place=place_kind(points_m),
    )


def _checked_points(points_m: ArrayLike, tolerance_m: float | None) -> Array:
    """The points of a task, (n, 3) [m].

    Raises:
        InputError: if they are none, or the tolerance is no length.
    """
    points = read_only(points_m, (3,), "points_m")
    if points.ndim != 2 or not np.all(np.isfinite(points)):
        raise InputError(f"points_m has shape {points.shape}, expected finite (n, 3)")
    if tolerance_m is not None and not 0 < tolerance_m < np.inf:
        raise InputError(f"tolerance_m is {tolerance_m}, expected a length above zero [m]")
    return points


def _choose_for_tolerance(prospect: Prospects, roots: Array, goal: _Goal, group_size: int) -> tuple[list[int], bool]:
    """The fewest groups of samples that reach the tolerance, of U of each, (n, p, q); and whether they do."""
    return choose_fewest(
        roots,
        prospect.covariance,
        goal.weight,
        MOST_SAMPLES // group_size,
        lambda covariance, groups: goal.expected_m(covariance, group_size * groups) <= goal.tolerance_m,
    )


def _steps(goal: _Goal, covariance: Array, roots: Array, group_size: int) -> tuple[tuple[int, float], ...]:
    """The error with none, one, two ... of what was chosen: U of each (n, p, q), by what is known before, (p, p)."""
    after = (each for _, each in greedy(roots, covariance, goal.weight))
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
    """The mean square error at the task that so many samples of an offer leave, beside those recorded [m^2]."""
    prospect = prospects(cell, recording, calibration, offers)
    goal = _make_goal(prospect, cell, calibration, points_m)
    _, covariance = choose_best(prospect, prospect.roots, goal.weight, count)
    return float(np.trace(goal.weight @ covariance))


def outlook(
    cell: Cell, recording: Recording, calibration: Calibration, points_m: Array
) -> tuple[tuple[int, float], ...]:
    """Gain of planned samples beside those recorded: their number, and the error that 95 of 100 stay below then [m].

    Args:
        cell: The cell.
        recording: What was recorded; all that has observations counts.
        calibration: Of it.
        points_m: (n, 3) the task in the reference's base [m]; (0, 3) is where the arms worked.

    Raises:
        InputError: if nothing is placed that the task is about, no pose is taught, or none near them can be taken.
    """
    known = sketches(cell, calibration)
    recording = synchronous(cell, recording, calibration)
    prospect = prospects(cell, recording, calibration, draw_offers(known, recording, OUTLOOK_CANDIDATES))
    goal = _make_goal(prospect, cell, calibration, points_m)
    steps = greedy(prospect.roots, prospect.covariance, goal.weight)
    covariances = [prospect.covariance, *(after for _, after in islice(steps, OUTLOOK_COUNTS[-1]))]
    return tuple(
        (count, goal.expected_m(covariances[count], count)) for count in OUTLOOK_COUNTS if count < len(covariances)
    )


def choose_best(prospect: Prospects, roots: Array, weight: Array, count: int) -> tuple[list[int], Array]:
    """The chosen candidates, greedy with exchange, and the covariance with them, (p, p)."""
    steps = list(islice(greedy(roots, prospect.covariance, weight), count))
    return exchange(roots, [found for found, _ in steps], steps[-1][1], weight)


def draw_offers(cell_sketches: Sequence[Sketch], recording: Recording, count: int, seed: int = 0) -> list[Offer]:
    """Candidates, `count` in all, of each camera and target that were seen or that taught poses show to one another.

    Args:
        cell_sketches: The cell by each camera and target.
        recording: Where robots stood.
        count: Of candidates.
        seed: Of the draws.

    Raises:
        InputError: if no pose is taught, or there is no candidate.
    """
    seen = {(o.camera, o.target) for sample in recording.samples for o in sample.observations}
    taught = {sketch.view: _teaching_samples(sketch, recording) for sketch in cell_sketches}
    cell_sketches = [sketch for sketch in cell_sketches if taught[sketch.view]]
    if not cell_sketches:
        raise InputError(
            "a plan begins at taught poses: jog the arms so that the target is in the middle of the image. Record "
            "that once or more, by basecal capture or by lines with `robots` alone in recording/samples.jsonl"
        )
    looked = [
        each for each in cell_sketches if each.view in seen or any(is_in_view(each, s) for s in taught[each.view])
    ]
    looked = looked or [cell_sketches[0]]
    found, why = list[Offer](), None
    for sketch in looked:
        try:
            states = _taught_states(sketch, taught[sketch.view])
            found.append((sketch, candidates(sketch, states, -(-count // len(looked)), seed)))
        except InputError as error:
            why = error
    if why is not None and not found:
        raise why
    return found


def plan_stations(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: ArrayLike,
    tolerance_m: float | None = None,
    count: int | None = None,
    seed: int = 0,
) -> Plan:
    """As `plan_for_task`, of whole stations of programmed shifts.

    They are those of the first camera and target that were seen, or that taught poses show.

    Raises:
        InputError: if no pose is taught, or no station can be shifted from.
    """
    known = sketches(cell, calibration)
    (sketch, _), *_ = draw_offers(known, recording, 1, seed)
    offered = [(sketch, stations(sketch, _taught_states(sketch, _teaching_samples(sketch, recording)), seed))]
    return plan_for_task(
        cell, recording, calibration, points_m, tolerance_m, count, seed, offers=offered, group_size=STATION_SAMPLES
    )


def _teaching_samples(sketch: Sketch, recording: Recording) -> list[Sample]:
    """Samples that say where the robots of a view stood; others may be anywhere."""
    return [sample for sample in recording.samples if set(sketch.movers) <= sample.robots.keys()]


def _taught_states(sketch: Sketch, samples: Sequence[Sample]) -> list[dict[str, RobotState]]:
    """Where the robots stood when the view was seen, or would be; anywhere where it nowhere would."""
    own = [s for s in samples if any((o.camera, o.target) == sketch.view for o in s.observations)]
    own = own or [s for s in samples if is_in_view(sketch, s)]
    return [dict(sample.robots) for sample in own or samples]


def _order_samples(
    sketch: Sketch, prospect: Prospects, recording: Recording, choice: Sequence[int], may_part: bool
) -> tuple[Sample, ...]:
    """The chosen samples, by a short way if each moves all arms and they may part; else as they were offered."""
    if not choice:
        return ()
    samples, first = [prospect.samples[k] for k in choice], prospect.samples[0].sample
    if may_part and all(set(sketch.cell.robots) <= sample.robots.keys() for sample in samples):
        home = next(s.robots for s in reversed(recording.samples) if set(sketch.cell.robots) <= s.robots.keys())
        samples = order_samples(sketch, home, samples)
    elif may_part:
        samples.sort(key=lambda sample: sample.sample)
    return tuple(_without_images(first + k, sample) for k, sample in enumerate(samples))


def _without_images(number: int, sample: Sample) -> Sample:
    """A sample with what is to be touched, and without what cameras are expected to see."""
    touches = tuple(seen for seen in sample.observations if isinstance(seen, TouchObservation))
    return Sample(number, robots=sample.robots, observations=touches)


def _expected_error_m(solution: Solution, goal: _Goal, count: int) -> float | None:
    if solution.observability.unobservable & {meeting.transform for meeting in goal.meetings}:
        return None
    return goal.expected_m(solution.covariance, count)


def _budget(solution: Solution, goal: _Goal, count: int) -> tuple[BudgetEntry, ...]:
    meeting = worst_meeting(goal.meetings, solution.covariance)
    total_m2 = meeting.mean_square_m2(solution.covariance)
    return budget(solution, meeting, total_m2 + goal.excess_m2(count), {})
