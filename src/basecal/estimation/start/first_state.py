"""A first value for every unknown, without a guess.

Pairs of camera and target are started one after another, those with fewest unknowns first; what one finds, the next
takes as known. A pair goes by a closed form where the data determine it, else by a grid over rotations whose best cells
are each refined. Everything is deterministic. `benchmarks.starts` judges its limits.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import numpy as np

from basecal.cell import Cell, Unknown
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import batch_states, bundle_adjust_batch
from basecal.estimation.least_squares.studentized_residuals import studentize_views
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.start.all_pairs import place_bases, placed_by_pairs
from basecal.estimation.start.closed_form import Loop, Triple, solve_rotations, solve_translations
from basecal.estimation.start.contacts import place_contacts, rigid_ends, turned_starts, without_contacts
from basecal.estimation.start.lens import lens_from_views
from basecal.estimation.start.light_search import light_search
from basecal.estimation.start.metric_points import has_metric_start, place_by_points
from basecal.estimation.start.pair_views import PairViews, as_light, pair_views, umeyama
from basecal.estimation.start.refinement import Refinement, pair_problem, refine_jointly
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import view_poses
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.batch import take
from basecal.numerics.steps import run_in_step

T = TypeVar("T")
_Search = Generator[Refinement, Triple, T]
Failure = BasecalError | np.linalg.LinAlgError

_FEW_VIEWS_POINTS = (20, 16)  # views and points of a start: 320 points determine 18 unknowns ten times over
_MANY_VIEWS_POINTS = (400, 1000)  # views and points of a thorough start
_LIGHT_STARTS = {0: 1, 1: 12, 2: 40}  # by unknown rotations; judged by benchmarks.starts
_BATCH_STARTS = 5  # starts of a light side by side: more may be in vain where one of the first convinces
_RIDGE = 1e-9  # of views of a point: where rays are parallel, depth stays that of the mount known so far
_TIGHT_RAD = 0.3  # a prior this narrow is a start by itself [rad]
_TURNED_STEPS = 30  # of descents from bases turned about what they touched: the best is refined again
_HEAVY_ROUNDS = 25  # rounds at most
_FIRST_STEPS = 3  # steps before the first weights: the start is rough
_SCALE_SHARE = 0.6  # of the views set the scale: three tenths may be reflections and still be outvoted


@dataclass
class _Known:
    """Transforms found so far: by name, and between bases none of which is placed yet."""

    transforms: dict[str, SE3] = field(default_factory=dict)
    relations: dict[tuple[str | None, str | None], SE3] = field(default_factory=dict)

    def base(self, name: str | None) -> SE3 | None:
        """Where a base stands in the world, if it is known; the reference has no name."""
        return SE3.identity() if name is None else self.transforms.get(name)

    def relation(self, eye_base: str | None, hand_base: str | None) -> SE3 | None:
        """`eye_base_from_hand_base` of a pair, if it is known."""
        eye, hand = self.base(eye_base), self.base(hand_base)
        if eye is not None and hand is not None:
            return eye.inverse() @ hand
        return self.relations.get((eye_base, hand_base))

    def add_relation(self, eye_base: str | None, hand_base: str | None, relation: SE3) -> None:
        """Add `eye_base_from_hand_base`, and place every base that it leads to."""
        self.relations[eye_base, hand_base] = relation
        self.transforms = place_bases(self.transforms, self.relations)


def first_state(problem: Problem, cell: Cell, thorough: bool) -> State:
    """A state to descend from.

    Args:
        problem: The problem.
        cell: Where the lenses and what is known of them stand.
        thorough: Use many views, their poses refined, and search even where a closed form seems clear.
    """
    found = first_states([problem], cell, thorough)[0]
    if isinstance(found, Exception):
        raise found
    return found


def first_states(problems: Sequence[Problem], cell: Cell, thorough: bool) -> list[State | Failure]:
    """A state to descend from for each of several problems of one cell, or the error that it ends in.

    Their searches go in step: what they want refined at a time is refined side by side.
    """
    return run_in_step([_try_search(problem, cell, thorough) for problem in problems], refine_jointly)


def _try_search(problem: Problem, cell: Cell, thorough: bool) -> _Search[State | Failure]:
    try:
        return (yield from _search(problem, cell, thorough))
    except (BasecalError, np.linalg.LinAlgError) as error:
        return error


def _search(problem: Problem, cell: Cell, thorough: bool) -> _Search[State]:
    """Pair after pair; it yields the starts of a pair to refine and receives the best."""
    cameras = lenses(problem, cell)
    most = _MANY_VIEWS_POINTS if thorough else _FEW_VIEWS_POINTS
    # Refined, views' poses lead to a start from which a descent is no shorter.
    poses_of = view_poses if thorough else partial(view_poses, iterations=0)
    known, simple = _Known(known_transforms(problem) | rigid_ends(problem)), without_contacts(problem)
    seen = [g for g in simple.groups if g.measurement.equations().any()]
    metric = [g for g in seen if has_metric_start(g, known.transforms)]
    waiting = [pair_views(g, cameras.get(g.camera), *most, poses_of) for g in seen if g not in metric]
    sights = tuple(waiting)
    in_vain: dict[int, str] = {}  # of a pair, what was unknown as it could not be started
    while waiting:
        unknown = {id(sight): _unknown(sight, known) for sight in waiting}
        waiting.sort(key=lambda s: (len(unknown[id(s)]), s.candidates is None, -s.total))
        for sight in waiting:
            if in_vain.get(id(sight)) == unknown[id(sight)]:
                continue
            if (yield from _start(sight, known, problem, thorough, is_forced=False)):
                break
            in_vain[id(sight)] = unknown[id(sight)]
        else:
            sight = waiting[0]
            yield from _start(sight, known, problem, thorough, is_forced=True)
        waiting.remove(sight)
    found = {**known.transforms, **place_by_points(simple, metric, known.transforms)}
    transforms = {name: found.get(name) or _fallback(u) for name, u in problem.unknowns.items()}
    transforms |= placed_by_pairs(problem, sights, transforms, known_transforms(problem))
    stated = known_transforms(problem)
    transforms |= {name: at for name, at in place_contacts(problem, transforms).items() if name not in stated}
    state = State(transforms, cameras, np.zeros((len(problem.stops), 6)))
    turned = list(turned_starts(problem, state, stated)) if thorough else []
    return _lowest_end(problem, turned) if turned else state


def _lowest_end(problem: Problem, states: Sequence[State]) -> State:
    """Where the descents from several states end lowest, after few steps."""
    ends = bundle_adjust_batch(problem, batch_states(problem, states), dof=1, iterations=_TURNED_STEPS)
    return take(ends.state, int(np.nanargmin(ends.cost)))


def guessed_state(problem: Problem, cell: Cell) -> State | None:
    """The state that the cell's guesses describe; None if an unknown has none."""
    if any(u.mean is None for u in problem.unknowns.values()):
        return None
    transforms = {name: _fallback(u) for name, u in problem.unknowns.items()}
    return State(transforms, lenses(problem, cell), np.zeros((len(problem.stops), 6)))


def lenses(problem: Problem, cell: Cell) -> dict[str, Camera]:
    """First values of the lenses: as stated, else from views of boards."""
    found = {}
    for name, intrinsics in problem.lenses.items():
        views = [g.measurement for g in problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        found[name] = intrinsics.camera or lens_from_views(cell.cameras[name], pixels)
    return found


def known_transforms(problem: Problem) -> dict[str, SE3]:
    """Transforms known well enough beforehand to start from."""
    return {
        name: u.mean
        for name, u in problem.unknowns.items()
        if u.mean is not None
        and (u.status == "fixed" or (u.status == "prior" and u.sigma is not None and u.sigma[3:].max() < _TIGHT_RAD))
    }


def _fallback(unknown: Unknown) -> SE3:
    return unknown.mean or SE3.identity()


def _loop(sight: PairViews, knowns: _Known, choice: IntArray | None = None) -> Loop:
    g = sight.group
    pick = np.zeros(len(g), dtype=np.int64) if choice is None else choice
    x, z = (knowns.transforms.get(end.mount) for end in g.ends)
    return sight.loop(x, knowns.relation(g.eye.base, g.hand.base), z, pick)


def _unknown(sight: PairViews, knowns: _Known) -> str:
    """The unknowns of a pair, as `Loop.unknown`."""
    g = sight.group
    related = (g.eye.base, g.hand.base) in knowns.relations
    has_y = related or all(end.base is None or end.base in knowns.transforms for end in g.ends)
    has = {"x": g.eye.mount in knowns.transforms, "y": has_y, "z": g.hand.mount in knowns.transforms}
    return "".join(name for name, there in has.items() if not there)


def _start(sight: PairViews, knowns: _Known, problem: Problem, thorough: bool, is_forced: bool) -> _Search[bool]:
    """Start one pair if the data determine it, or in any case where `is_forced`; whether it was done."""
    loop = _loop(sight, knowns)
    found: Triple | None = None
    if not loop.unknown:
        return True
    is_point = sight.group.hand.mount in problem.point_mounts
    if sight.candidates is None:
        found = (yield from _light(sight, loop, is_point)) if is_forced else None
    else:
        found = _solve_closed_form(sight, knowns)
        if (found is None and is_forced) or (found is not None and thorough):
            # By a grid over rotations and the closed form if there is one, the best of them refined.
            found = yield Refinement(sight, loop, [] if found is None else [found], is_point, searched=True)
    if found is None:
        return False
    g = sight.group
    knowns.transforms[g.eye.mount], knowns.transforms[g.hand.mount] = found[0], found[2]
    if loop.y is None:
        knowns.add_relation(g.eye.base, g.hand.base, found[1])
    return True


def _solve_closed_form(sight: PairViews, knowns: _Known) -> Triple | None:
    """Solve by closed form, each view's better pose chosen anew until it is stable; None if it is not unique."""
    chosen = np.zeros(len(sight.group), dtype=np.int64)
    for _ in range(4):
        loop = _loop(sight, knowns, chosen)
        found = solve_rotations(loop)
        if not found.clear:
            return None
        triple = solve_translations(loop, found)
        better = sight.closest_pose(triple)
        if np.array_equal(better, chosen):
            break
        chosen = better
    return triple


def light_states(problem: Problem, cell: Cell, max_count: int) -> Iterator[State]:
    """Where a search for a single light ends from each of its starts, by weights that leave out what is far off.

    The end that fits all views best may be wrong where some of the views are.

    Args:
        problem: The problem; nothing is given unless it is of one camera that sees one light.
        cell: What exists and what is known.
        max_count: How many starts.
    """
    cameras, known = lenses(problem, cell), _Known(known_transforms(problem))
    if len(problem.groups) != 1 or problem.groups[0].hand.mount not in problem.point_mounts:
        return
    if has_metric_start(problem.groups[0], known.transforms):
        return
    sight = pair_views(problem.groups[0], cameras.get(problem.groups[0].camera), *_MANY_VIEWS_POINTS)
    as_point, light, starts = light_search(sight, _loop(sight, known), max_count)
    g = sight.group
    fixed = {name: _fallback(unknown) for name, unknown in problem.unknowns.items()}
    pair = pair_problem(as_point, light, True)
    for at in range(0, len(starts), _BATCH_STARTS):
        some = starts[at : at + _BATCH_STARTS]
        begun = {name: SE3.stack(list(of)) for name, of in zip("xyz", zip(*some, strict=True), strict=True)}
        ends = cauchy_irls(pair, State(begun, {}, np.zeros((len(some), 0, 6)))).transforms
        for k in range(len(some)):
            x, y, z = (ends[name][k] for name in "xyz")
            moved = {g.eye.mount: x, g.hand.mount: z} | g.placed_base(y, fixed, fixed)
            yield State({**fixed, **moved}, cameras, np.zeros((len(problem.stops), 6)))


def _light(sight: PairViews, loop: Loop, is_point: bool) -> _Search[Triple]:
    """Solve as for a single LED; the target's other points are placed afterwards."""
    chords, point = as_light(sight.group.measurement)
    turns = (loop.x is None) + (loop.y is None)
    as_point, light, starts = light_search(sight, loop, _LIGHT_STARTS[turns])
    x, y, at = yield Refinement(as_point, light, starts, True)
    if is_point or loop.z is not None:
        shift = SE3(np.eye(3), at.translation - chords.points_in_target[point]) if is_point else loop.z
        assert shift is not None
        return x, y, shift
    return x, y, _mount_of_points(sight, x, y, at)


def _mount_of_points(sight: PairViews, x: SE3, y: SE3, places: SE3) -> SE3:
    """`hand_flange_from_target` from where each of its points is found in the flange."""
    chords, _ = as_light(sight.group.measurement)
    g = sight.group
    camera_from_flange = (g.eye.base_from_flange @ x).inverse() @ y @ g.hand.base_from_flange
    bearings = (camera_from_flange.rotation.mT[:, None] @ chords.bearings_in_camera[..., None])[..., 0]
    origin_in_flange = camera_from_flange.inverse().translation
    across = (np.eye(3) - bearings[..., :, None] * bearings[..., None, :]) * (chords.weight > 0)[..., None, None]
    total = across.sum(0) + _RIDGE * np.eye(3)
    right = (across @ origin_in_flange[:, None, :, None]).sum(0) + _RIDGE * places.translation[:, None]
    points_in_flange = np.linalg.solve(total, right)[..., 0]
    return umeyama(chords.points_in_target, points_in_flange[None], np.ones((1, len(points_in_flange))))[0]


def cauchy_irls(problem: Problem, states: State) -> State:
    """The states of Cauchy's likelihood over views, downhill of a batch of states, each of its own scale.

    Weights never end at zero. The scale is that of six tenths of the views. Where a state is not finite all stay where
    they are by then. Source: Holland & Welsch 1977 (iteratively reweighted least squares).
    """
    weights: list[Array] | None = None
    for _ in range(_HEAVY_ROUNDS):
        try:
            states = bundle_adjust_batch(problem, states, 1, _FIRST_STEPS if weights is None else 1, weights).state
            ratios = [np.minimum(s.value, 1e30) / np.maximum(s.freedoms, 1) for s in studentize_views(problem, states)]
        except np.linalg.LinAlgError:
            break
        scale = np.maximum(np.quantile(np.concatenate(ratios, -1), _SCALE_SHARE, axis=-1, keepdims=True), 1e-30)
        weights = [1 / (1 + ratio / scale) for ratio in ratios]
    return states
