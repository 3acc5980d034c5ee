"""A plan: the samples that a tolerance at the task needs, or why no samples reach it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from basecal.accuracy.task.budget import budget
from basecal.accuracy.task.expected_error import length_quantiles, point_covariances
from basecal.accuracy.task.task import Task, base_transforms, least_known, make_task
from basecal.cell import BudgetEntry, Calibration, Cell, Recording, RobotState, Sample
from basecal.errors import InputError
from basecal.estimation.solve import Solution
from basecal.estimation.streams.streams import synchronous
from basecal.geometry import Array
from basecal.planning.candidates import candidates
from basecal.planning.choose import choose_fewest, exchange, greedy
from basecal.planning.feasible import is_in_view
from basecal.planning.poses import order_samples
from basecal.planning.prospects import Prospects, prospects, sketches
from basecal.planning.sketch import Sketch
from basecal.planning.stations import stations

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
    """What to record.

    Attributes:
        samples: Where the robots shall be, in an order that makes their way short.
        needed: How many samples the tolerance needs beside those recorded; None if it is not reached, or not stated.
        expected_m: The distance that 95 of 100 errors at the task stay below, with the samples taken [m]; None if
            even then a direction is open.
        reachable: Whether the tolerance is; None if none is stated.
        recorded: How many samples are recorded already and count.
        budget: The error at the task by source, with the samples taken.
    """

    samples: tuple[Sample, ...]
    needed: int | None
    expected_m: float | None
    reachable: bool | None
    recorded: int
    budget: tuple[BudgetEntry, ...]


@dataclass(frozen=True, eq=False)
class _Goal:
    """The tasks of all that is placed, and the tolerance."""

    tasks: tuple[Task, ...]
    tolerance_m: float

    def expected_m(self, covariances: dict[str, Array]) -> float:
        """The largest error of any of them at any of its points [m]."""
        at = [point_covariances(covariances[task.transform], task.points_m) for task in self.tasks]
        return float(length_quantiles(np.concatenate(at)).max())


def plan_for_task(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: Array,
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
        points_m: (n, 3) the task in the reference's base [m].
        tolerance_m: The error that 95 of 100 are to stay below [m].
        count: How many samples; as many as the tolerance needs where None.
        seed: Of the draws.
        offers: What there is to choose from; drawn near taught poses where None.
        group_size: How many of these, one after another, are taken together, such as those of a station.

    Raises:
        InputError: if nothing is placed that the task is about, no pose is taught, or a transform has no guess.
    """
    names = base_transforms(cell)
    known = sketches(cell, calibration)
    recording = synchronous(cell, recording, calibration)
    if offers is None:
        offers = draw_offers(known, recording, CANDIDATES, seed)
    prospect = prospects(cell, recording, calibration, offers)
    tasks = tuple(make_task(name, known[0].transforms, points_m) for name in names)
    goal = _Goal(tasks, np.inf if tolerance_m is None else tolerance_m)
    roots = prospect.roots if group_size == 1 else prospect.group_roots(group_size)
    chosen, reached = list[int](), None
    if tolerance_m is not None:
        chosen, reached = _choose_fewest(prospect, roots, goal, MOST_SAMPLES // group_size)
    needed = group_size * len(chosen) if reached else None
    if count is not None and -(-count // group_size) != len(chosen):
        chosen = choose_best(prospect, roots, _weight(prospect, goal), -(-count // group_size))
    rows = [group_size * k + each for k in chosen for each in range(group_size)]
    solution = prospect.solution(rows)
    return Plan(
        _order_samples(known[0], prospect, recording, rows, group_size == 1),
        needed,
        _expected_error_m(solution, goal),
        reached,
        len(prospect.recorded),
        _budget(solution, goal),
    )


def outlook(
    cell: Cell, recording: Recording, calibration: Calibration, points_m: Array
) -> tuple[tuple[int, float], ...]:
    """What planned samples beside those recorded bring: how many, and the error that 95 of 100 stay below then [m].

    Args:
        cell: The cell.
        recording: What was recorded; all that has observations counts.
        calibration: Of it.
        points_m: (n, 3) the task in the reference's base [m].

    Raises:
        InputError: if nothing is placed that the task is about, no pose is taught, or none near them can be taken.
    """
    known = sketches(cell, calibration)
    recording = synchronous(cell, recording, calibration)
    prospect = prospects(cell, recording, calibration, draw_offers(known, recording, OUTLOOK_CANDIDATES))
    goal = _Goal(tuple(make_task(name, known[0].transforms, points_m) for name in base_transforms(cell)), np.inf)
    steps = greedy(prospect.roots, prospect.covariance, _weight(prospect, goal))
    covariances = [prospect.covariance, *(after for _, after in islice(steps, OUTLOOK_COUNTS[-1]))]
    columns = [(task.transform, prospect.problem.columns[task.transform]) for task in goal.tasks]
    return tuple(
        (count, goal.expected_m({name: _pad_covariance(covariances[count], where) for name, where in columns}))
        for count in OUTLOOK_COUNTS
        if count < len(covariances)
    )


def _choose_fewest(prospect: Prospects, roots: Array, goal: _Goal, most: int) -> tuple[list[int], bool]:
    """As few candidates as the tolerance needs, or the best that are allowed, and whether it is met."""
    columns = prospect.problem.columns
    names = [task.transform for task in goal.tasks]

    def is_enough(covariance: Array) -> bool:
        """Whether the tolerance is met."""
        return goal.expected_m({n: _pad_covariance(covariance, columns[n]) for n in names}) <= goal.tolerance_m

    return choose_fewest(roots, prospect.covariance, _weight(prospect, goal), most, is_enough)


def choose_best(prospect: Prospects, roots: Array, weight: Array, count: int) -> list[int]:
    """So many candidates, greedy with exchange."""
    steps = list(islice(greedy(roots, prospect.covariance, weight), count))
    return exchange(roots, [found for found, _ in steps], steps[-1][1], weight)[0]


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
    taught = [sample for sample in recording.samples if set(cell_sketches[0].cell.robots) <= sample.robots.keys()]
    if not taught:
        raise InputError(
            "a plan begins at taught poses: jog the arms so that the target is in the middle of the picture, and "
            "record that once or more (basecal capture, or lines with `robots` alone in recording/samples.jsonl)"
        )
    looked = [each for each in cell_sketches if each.view in seen or any(is_in_view(each, sample) for sample in taught)]
    looked = looked or [cell_sketches[0]]
    found, why = list[Offer](), None
    for sketch in looked:
        try:
            found.append((sketch, candidates(sketch, _taught_states(sketch, taught), -(-count // len(looked)), seed)))
        except InputError as error:
            why = error
    if why is not None and not found:
        raise why
    return found


def offered_stations(cell: Cell, recording: Recording, calibration: Calibration | None, seed: int = 0) -> list[Offer]:
    """Stations of programmed shifts, of the first camera and target that were seen, or that taught poses show.

    Raises:
        InputError: if no pose is taught, or no station can be shifted from.
    """
    known = sketches(cell, calibration)
    (sketch, _), *_ = draw_offers(known, recording, 1, seed)
    taught = [sample for sample in recording.samples if set(cell.robots) <= sample.robots.keys()]
    return [(sketch, stations(sketch, _taught_states(sketch, taught), seed))]


def _taught_states(sketch: Sketch, samples: Sequence[Sample]) -> list[dict[str, RobotState]]:
    """Where the robots stood when the view was seen, or would be; anywhere where it nowhere would."""
    own = [s for s in samples if any((o.camera, o.target) == sketch.view for o in s.observations)]
    own = own or [s for s in samples if is_in_view(sketch, s)]
    return [dict(sample.robots) for sample in own or samples]


def _weight(prospect: Prospects, goal: _Goal) -> Array:
    """The criterion's weight of all columns, (p, p)."""
    weight = np.zeros((prospect.problem.width, prospect.problem.width))
    for task in goal.tasks:
        where = prospect.problem.columns[task.transform]
        size = where.stop - where.start
        weight[where, where] += task.weight()[:size, :size]
    return weight


def _pad_covariance(covariance: Array, rows: slice) -> Array:
    """The covariance of a transform, (6, 6); of a point's mount without rotation."""
    own, size = np.zeros((6, 6)), rows.stop - rows.start
    own[:size, :size] = covariance[rows, rows]
    return own


def _order_samples(
    sketch: Sketch, prospect: Prospects, recording: Recording, choice: Sequence[int], may_part: bool
) -> tuple[Sample, ...]:
    if not choice:
        return ()
    home = next(s.robots for s in reversed(recording.samples) if set(sketch.cell.robots) <= s.robots.keys())
    samples = [prospect.samples[k] for k in choice]
    samples = order_samples(sketch, home, samples) if may_part else samples
    first = prospect.samples[0].sample
    return tuple(Sample(first + k, robots=sample.robots) for k, sample in enumerate(samples))


def _expected_error_m(solution: Solution, goal: _Goal) -> float | None:
    names = [task.transform for task in goal.tasks]
    if solution.observability.unobservable & set(names):
        return None
    return goal.expected_m({name: solution.transforms[name].covariance for name in names})


def _budget(solution: Solution, goal: _Goal) -> tuple[BudgetEntry, ...]:
    if _expected_error_m(solution, goal) is None:
        return ()
    covariances = {task.transform: solution.transforms[task.transform].covariance for task in goal.tasks}
    task = least_known(goal.tasks, covariances)
    return budget(solution, task, task.variance_m2(covariances[task.transform]), {})
