"""Start values of all unknowns, without an initial guess.

Pairs of camera and target are solved one after another, those with the fewest unknowns first; each result is known to
the next pairs. A pair is solved in closed form if the data determine it uniquely. Otherwise, the best cells of a grid
of rotations are refined. The search is deterministic. The thresholds are validated by `benchmarks.starts`.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import numpy as np

from basecal.cell import Cell, Unknown
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import batch_states, bundle_adjust_batch
from basecal.estimation.least_squares.studentized_residuals import view_misfits
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.start.all_pairs import place_by_pairs
from basecal.estimation.start.closed_form import Loop, Triple, solve_rotations, solve_translations
from basecal.estimation.start.contacts import place_contacts, rigid_part_mounts, rotated_base_states, without_contacts
from basecal.estimation.start.led_search import led_search
from basecal.estimation.start.lens import lens_from_views
from basecal.estimation.start.metric_points import has_metric_start, place_by_points
from basecal.estimation.start.pair_views import PairViews, led_point, pair_views, umeyama
from basecal.estimation.start.pose_graph import place_bases
from basecal.estimation.start.refinement import Refinement, pair_problem, refine_jointly
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import view_poses
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.steps import run_in_step

T = TypeVar("T")
_Search = Generator[Refinement, Triple, T]
Failure = BasecalError | np.linalg.LinAlgError

_FEW_VIEWS_POINTS = (20, 16)  # views and points of a start: 320 points overdetermine 18 unknowns more than tenfold
_MANY_VIEWS_POINTS = (400, 1000)  # views and points of a thorough start
_LED_STARTS = {0: 1, 1: 12, 2: 40}  # by number of unknown rotations; validated by benchmarks.starts
_BATCH_STARTS = 5  # starts of an LED in a batch: one of the first may already be convincing
_RIDGE = 1e-9  # information of the approximate mount, which sets the depth of a point if its rays are parallel
_TIGHT_RAD = 0.3  # [rad] a prior with a smaller sigma is a start value
_ROTATED_STEPS = 30  # steps of descents from bases rotated about their contacts: the best is refined again
_REWEIGHTING_ROUNDS = 25  # maximum number of reweighting rounds
_FIRST_STEPS = 3  # steps before the first weights, since the start is rough
_SCALE_SHARE = 0.6  # quantile of the views that is the scale: up to 30 % of the views may be reflections


@dataclass
class _Knowledge:
    """Transforms known so far: by name, and relations between bases."""

    transforms: dict[str, SE3] = field(default_factory=dict)
    relations: dict[tuple[str | None, str | None], SE3] = field(default_factory=dict)

    def base(self, name: str | None) -> SE3 | None:
        """Pose of a base in the world, or None if it is unknown; the name of the reference is None."""
        return SE3.identity() if name is None else self.transforms.get(name)

    def relation(self, eye_base: str | None, hand_base: str | None) -> SE3 | None:
        """Return `eye_base_from_hand_base` of a pair, or None if it is unknown."""
        eye, hand = self.base(eye_base), self.base(hand_base)
        if eye is not None and hand is not None:
            return eye.inverse() @ hand
        return self.relations.get((eye_base, hand_base))

    def add_relation(self, eye_base: str | None, hand_base: str | None, relation: SE3) -> None:
        """Add `eye_base_from_hand_base`, and place every base that becomes connected."""
        self.relations[eye_base, hand_base] = relation
        self.transforms = place_bases(self.transforms, self.relations)

    def place_unrelated_bases(self, unknowns: Mapping[str, Unknown]) -> None:
        """Place the bases that no relation connects to the reference: of each connected part, the first at its mean."""
        for base in dict.fromkeys(name for pair in self.relations for name in pair if name is not None):
            if base not in self.transforms:
                first = {base: _mean_or_identity(unknowns[base])}
                self.transforms = place_bases(self.transforms | first, self.relations)


def first_state(problem: Problem, cell: Cell, thorough: bool) -> State:
    """Find a start for the descent.

    Args:
        problem: The problem.
        cell: The cell with the cameras.
        thorough: Whether to use many views with refined poses, and to search even if a closed form is unique.

    Raises:
        BasecalError: if there is no start.
    """
    result = first_states([problem], cell, thorough)[0]
    if isinstance(result, Exception):
        raise result
    return result


def first_states(problems: Sequence[Problem], cell: Cell, thorough: bool) -> list[State | Failure]:
    """Find a start for each of several problems of one cell; the error for problems that fail.

    The searches advance together, so that their refinements form batches.
    """
    return run_in_step([_try_search(problem, cell, thorough) for problem in problems], refine_jointly)


def _try_search(problem: Problem, cell: Cell, thorough: bool) -> _Search[State | Failure]:
    try:
        return (yield from _search(problem, cell, thorough))
    except (BasecalError, np.linalg.LinAlgError) as error:
        return error


def _search(problem: Problem, cell: Cell, thorough: bool) -> _Search[State]:
    """Search pair by pair; yields starts of a pair for refinement and receives the best."""
    cameras = lenses(problem, cell)
    view_and_point_counts = _MANY_VIEWS_POINTS if thorough else _FEW_VIEWS_POINTS
    # Refined poses of views do not shorten the descent, so they are used in a thorough search only.
    estimate_poses = view_poses if thorough else partial(view_poses, iterations=0)
    knowledge, point_problem = (
        _Knowledge(known_transforms(problem) | rigid_part_mounts(problem)),
        without_contacts(problem),
    )
    groups = [g for g in point_problem.groups if g.measurement.equations().any()]
    metric = [g for g in groups if has_metric_start(g, knowledge.transforms)]
    waiting = [
        pair_views(g, cameras.get(g.camera), *view_and_point_counts, estimate_poses) for g in groups if g not in metric
    ]
    pairs = tuple(waiting)
    failed_at: dict[int, str] = {}  # unknowns of each pair at its last failed attempt
    while waiting:
        unknowns = {id(pair): _unknown_letters(pair, knowledge) for pair in waiting}
        waiting.sort(key=lambda s: (len(unknowns[id(s)]), s.candidates is None, -s.total))
        for pair in waiting:
            if failed_at.get(id(pair)) == unknowns[id(pair)]:
                continue
            if (yield from _solve_pair(pair, knowledge, problem, thorough, is_forced=False)):
                break
            failed_at[id(pair)] = unknowns[id(pair)]
        else:
            pair = waiting[0]
            yield from _solve_pair(pair, knowledge, problem, thorough, is_forced=True)
        waiting.remove(pair)
    knowledge.place_unrelated_bases(problem.unknowns)
    found = {**knowledge.transforms, **place_by_points(point_problem, metric, knowledge.transforms)}
    transforms = {name: found.get(name) or _mean_or_identity(u) for name, u in problem.unknowns.items()}
    transforms |= place_by_pairs(problem, pairs, transforms, known_transforms(problem))
    stated = known_transforms(problem)
    transforms |= {name: mount for name, mount in place_contacts(problem, transforms).items() if name not in stated}
    state = State(transforms, cameras, np.zeros((len(problem.stops), 6)))
    rotated = list(rotated_base_states(problem, state, stated)) if thorough else []
    return _lowest_cost_state(problem, rotated) if rotated else state


def _lowest_cost_state(problem: Problem, states: Sequence[State]) -> State:
    """Return the state with the lowest cost after short descents from several states."""
    return bundle_adjust_batch(problem, batch_states(problem, states), dof=1, iterations=_ROTATED_STEPS).best_state


def guessed_state(problem: Problem, cell: Cell) -> State | None:
    """State of the guesses in the cell; None if an unknown has no guess."""
    if any(u.mean is None for u in problem.unknowns.values()):
        return None
    transforms = {name: _mean_or_identity(u) for name, u in problem.unknowns.items()}
    return State(transforms, lenses(problem, cell), np.zeros((len(problem.stops), 6)))


def lenses(problem: Problem, cell: Cell) -> dict[str, Camera]:
    """Start values of the lenses: the stated lens, or an estimate from views of boards."""
    cameras = {}
    for name, intrinsics in problem.lenses.items():
        views = [g.measurement for g in problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        cameras[name] = intrinsics.camera or lens_from_views(cell.cameras[name], pixels)
    return cameras


def known_transforms(problem: Problem) -> dict[str, SE3]:
    """Transforms that are fixed or have a narrow prior, by name."""
    return {
        name: u.mean
        for name, u in problem.unknowns.items()
        if u.mean is not None
        and (u.status == "fixed" or (u.status == "prior" and u.sigma is not None and u.sigma[3:].max() < _TIGHT_RAD))
    }


def _mean_or_identity(unknown: Unknown) -> SE3:
    return unknown.mean or SE3.identity()


def _loop(pair: PairViews, knowledge: _Knowledge, choice: IntArray | None = None) -> Loop:
    group = pair.group
    pose_indices = np.zeros(len(group), dtype=np.int64) if choice is None else choice
    x, z = (knowledge.transforms.get(end.mount) for end in group.ends)
    return pair.loop(x, knowledge.relation(group.eye.base, group.hand.base), z, pose_indices)


def _unknown_letters(pair: PairViews, knowledge: _Knowledge) -> str:
    """Letters of the unknowns of a pair, as in `Loop.unknown`."""
    group = pair.group
    has_relation = (group.eye.base, group.hand.base) in knowledge.relations
    has_y = has_relation or all(end.base is None or end.base in knowledge.transforms for end in group.ends)
    is_known = {"x": group.eye.mount in knowledge.transforms, "y": has_y, "z": group.hand.mount in knowledge.transforms}
    return "".join(name for name, is_there in is_known.items() if not is_there)


def _solve_pair(
    pair: PairViews, knowledge: _Knowledge, problem: Problem, thorough: bool, is_forced: bool
) -> _Search[bool]:
    """Solve one pair if the data determine it, or in any case if `is_forced`; return whether it was solved."""
    loop = _loop(pair, knowledge)
    triple: Triple | None = None
    if not loop.unknown:
        return True
    is_point = pair.group.hand.mount in problem.point_mounts
    if pair.candidates is None:
        triple = (yield from _solve_as_led(pair, loop, is_point)) if is_forced else None
    else:
        triple = _solve_closed_form(pair, knowledge)
        if (triple is None and is_forced) or (triple is not None and thorough):
            # Refine the best starts of a grid of rotations and, if available, of the closed form.
            triple = yield Refinement(pair, loop, [] if triple is None else [triple], is_point, searched=True)
    if triple is None:
        return False
    group = pair.group
    knowledge.transforms[group.eye.mount], knowledge.transforms[group.hand.mount] = triple[0], triple[2]
    if loop.y is None:
        knowledge.add_relation(group.eye.base, group.hand.base, triple[1])
    return True


def _solve_closed_form(pair: PairViews, knowledge: _Knowledge) -> Triple | None:
    """Solve in closed form, iterating the choice between each view's two poses; None if it is not unique."""
    chosen = np.zeros(len(pair.group), dtype=np.int64)
    for _ in range(4):
        loop = _loop(pair, knowledge, chosen)
        rotations = solve_rotations(loop)
        if not rotations.clear:
            return None
        triple = solve_translations(loop, rotations)
        closest = pair.closest_pose(triple)
        if np.array_equal(closest, chosen):
            break
        chosen = closest
    return triple


def led_states(problem: Problem, cell: Cell, max_count: int) -> Iterator[State]:
    """Yield robustly fitted states of a single LED, one for each start of its search.

    The state with the lowest cost over all views may be wrong if some views are.

    Args:
        problem: The problem; no state is yielded unless it has a single camera that observes a single LED.
        cell: The cell.
        max_count: Maximum number of starts.
    """
    cameras, knowledge = lenses(problem, cell), _Knowledge(known_transforms(problem))
    if len(problem.groups) != 1 or problem.groups[0].hand.mount not in problem.point_mounts:
        return
    if has_metric_start(problem.groups[0], knowledge.transforms):
        return
    pair = pair_views(problem.groups[0], cameras.get(problem.groups[0].camera), *_MANY_VIEWS_POINTS)
    point_pair, led_loop, starts = led_search(pair, _loop(pair, knowledge), max_count)
    group = pair.group
    fixed = {name: _mean_or_identity(unknown) for name, unknown in problem.unknowns.items()}
    led_problem = pair_problem(point_pair, led_loop, True)
    for first in range(0, len(starts), _BATCH_STARTS):
        batch = starts[first : first + _BATCH_STARTS]
        transforms = {
            name: SE3.stack(list(letter_starts))
            for name, letter_starts in zip("xyz", zip(*batch, strict=True), strict=True)
        }
        fitted = cauchy_irls(led_problem, State(transforms, {}, np.zeros((len(batch), 0, 6)))).transforms
        for k in range(len(batch)):
            x, y, z = (fitted[name][k] for name in "xyz")
            solved = {group.eye.mount: x, group.hand.mount: z} | group.placed_base(y, fixed, fixed)
            yield State({**fixed, **solved}, cameras, np.zeros((len(problem.stops), 6)))


def _solve_as_led(pair: PairViews, loop: Loop, is_point: bool) -> _Search[Triple]:
    """Solve a pair as for a single LED; the target's other points are placed afterwards."""
    bearings, point = led_point(pair.group.measurement)
    rotation_count = (loop.x is None) + (loop.y is None)
    point_pair, led_loop, starts = led_search(pair, loop, _LED_STARTS[rotation_count])
    x, y, led_mount = yield Refinement(point_pair, led_loop, starts, True)
    if is_point or loop.z is not None:
        mount = SE3(np.eye(3), led_mount.translation - bearings.points_in_target[point]) if is_point else loop.z
        assert mount is not None
        return x, y, mount
    return x, y, _mount_of_points(pair, x, y, led_mount)


def _mount_of_points(pair: PairViews, x: SE3, y: SE3, led_mount: SE3) -> SE3:
    """Find `hand_flange_from_target` by triangulation of the target's points in the flange frame."""
    measured, _ = led_point(pair.group.measurement)
    group = pair.group
    camera_from_flange = (group.eye.base_from_flange @ x).inverse() @ y @ group.hand.base_from_flange
    bearings = (camera_from_flange.rotation.mT[:, None] @ measured.bearings_in_camera[..., None])[..., 0]
    origin_in_flange = camera_from_flange.inverse().translation
    projections = (np.eye(3) - bearings[..., :, None] * bearings[..., None, :]) * (measured.weight > 0)[..., None, None]
    information = projections.sum(0) + _RIDGE * np.eye(3)
    right = (projections @ origin_in_flange[:, None, :, None]).sum(0) + _RIDGE * led_mount.translation[:, None]
    points_in_flange = np.linalg.solve(information, right)[..., 0]
    return umeyama(measured.points_in_target, points_in_flange[None], np.ones((1, len(points_in_flange))))[0]


def cauchy_irls(problem: Problem, states: State) -> State:
    """Fit a batch of states by iteratively reweighted least squares with the Cauchy loss over views.

    Each state has its own scale, the 60 % quantile of its squared deviations. Weights are never zero. If the solve
    fails, the last states are returned. Source: Holland & Welsch 1977.
    """
    weights: list[Array] | None = None
    for _ in range(_REWEIGHTING_ROUNDS):
        try:
            states = bundle_adjust_batch(problem, states, 1, _FIRST_STEPS if weights is None else 1, weights).state
            ratios = [np.minimum(s.value, 1e30) / np.maximum(s.freedoms, 1) for s in view_misfits(problem, states)]
        except np.linalg.LinAlgError:
            break
        scale = np.maximum(np.quantile(np.concatenate(ratios, -1), _SCALE_SHARE, axis=-1, keepdims=True), 1e-30)
        weights = [1 / (1 + ratio / scale) for ratio in ratios]
    return states
