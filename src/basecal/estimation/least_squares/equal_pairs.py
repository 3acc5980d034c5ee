"""Pairs of camera and target that are equal in all but where they are, as one batch: each ties its own few unknowns.

A cell of a hundred robots has hundreds of pairs. As a batch they are linearised at the cost of their views.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.least_squares.normal_equations import NormalEquations, linearise, retract
from basecal.estimation.problem.problem import Problem, State, Stops, sequential_columns
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.batch import stack

MOST_VIEWS = 2000
"""Of a batch: more gain nothing, and take memory that no cache holds; `benchmarks.robots`."""

_LENS_FIELD = "camera"
_NAMES = ("eye", "hand")  # of the ends


@dataclass(frozen=True, eq=False)
class AlikePairs:
    """Pairs of one structure.

    Attributes:
        problem: One group of views (b, n), whose unknowns have the names of the pair's fields.
        groups: Which groups of the cell's problem they are, (b,).
        names: Of each pair, the transform by the field that names it.
        cameras: Of each pair.
        rows: (b, n) the views in the pair's group, the first again where it has fewer.
        weight: (b, n) 1, and 0 of views that are there again.
        columns: (b, m) where the pair's unknowns stand among the cell's.
        stops: (b, 2 n) the stops of eye and hand, or fewer where one of them has no noise.
    """

    problem: Problem
    groups: tuple[int, ...]
    names: tuple[Mapping[str, str], ...]
    cameras: tuple[str, ...]
    rows: IntArray
    weight: Array
    columns: IntArray
    stops: IntArray

    @cached_property
    def _fields(self) -> tuple[str, ...]:
        return tuple(self.names[0])

    def state(self, state: State) -> State:
        """The pairs' own states, (b,), of the cell's."""
        transforms = {f: SE3.stack([state.transforms[names[f]] for names in self.names]) for f in self._fields}
        cameras: dict[str, Camera] = {}
        if self.cameras[0] in state.cameras:
            lenses = [state.cameras[name] for name in self.cameras]
            cameras[_LENS_FIELD] = lenses[0].with_parameters(np.stack([lens.parameters for lens in lenses]))
        return State(transforms, cameras, state.stop_errors[self.stops])

    def linearise(self, own: State, weights: Sequence[Array] | None) -> NormalEquations:
        """The pairs to second order, (b,); weights of views are by the cell's groups, 1 where None."""
        weight = self.weight
        if weights is not None:
            weight = weight * np.stack([weights[g][row] for g, row in zip(self.groups, self.rows, strict=True)])
        # Where every view is there once and counts, as without weights: this is the rule, and saves time.
        return linearise(self.problem, own, None if weight.all() and np.all(weight == 1) else [weight])

    def stop_errors(self, own: State, model: NormalEquations, step: Array) -> Array:
        """The errors of the pairs' stops, (b, 2 n, 6), after a step of all columns (p,)."""
        return retract(self.problem, own, model, step[self.columns]).stop_errors


def group_pairs(problem: Problem) -> tuple[AlikePairs, ...]:
    """The pairs of a cell by structure; no stop that several views share may have noise."""
    by_structure: dict[Hashable, list[int]] = defaultdict(list)
    for number, group in enumerate(problem.groups):
        if len(group):
            by_structure[_structure(problem, group)].append(number)
    return tuple(_join_pairs(problem, few) for numbers in by_structure.values() for few in _parts(problem, numbers))


def _parts(problem: Problem, numbers: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Pairs of one structure in parts of at most `MOST_VIEWS`, or of one pair."""
    part: list[int] = []
    for number in numbers:
        if part and (len(part) + 1) * max(len(problem.groups[k]) for k in (*part, number)) > MOST_VIEWS:
            yield tuple(part)
            part = []
        part.append(number)
    yield tuple(part)


def _structure(problem: Problem, group: ViewGroup) -> Hashable:
    """The structure that the pairs of one batch share."""
    points = getattr(group.measurement, "points_in_target", np.zeros((0, 3)))
    lens = problem.lenses.get(group.camera)
    widths = tuple((of, problem.column_width(name)) for of, name in _frames(group).items())
    # Each stop has a sigma of its own; those of a robot are alike.
    sigmas = tuple(problem.stops.sigma[end.stop[0]].tobytes() if end.has_noise else b"" for end in group.ends)
    still = tuple(end.robot is None for end in group.ends)
    of_lens = (lens is not None, problem.column_width(group.camera))
    return type(group.measurement), points.tobytes(), still, widths, of_lens, sigmas


def _frames(group: ViewGroup) -> dict[str, str]:
    """The transforms of a group by their names in pairs."""
    named = {}
    for name, end in zip(_NAMES, group.ends, strict=True):
        named[f"{name}_mount"] = end.mount
        if end.base is not None:
            named[f"{name}_base"] = end.base
    return named


def _join_pairs(problem: Problem, numbers: tuple[int, ...]) -> AlikePairs:
    groups = [problem.groups[number] for number in numbers]
    frames = [_frames(group) for group in groups]
    most = max(map(len, groups))
    rows = np.stack([np.where(np.arange(most) < len(g), np.arange(most), 0) for g in groups])
    taken = [group.take(row) for group, row in zip(groups, rows, strict=True)]
    fields = {**frames[0], _LENS_FIELD: groups[0].camera}
    widths = {of: problem.column_width(name) for of, name in fields.items() if name in problem.columns}
    where = [
        np.r_[tuple(problem.columns[named.get(of, group.camera)] for of in widths)]
        for group, named in zip(groups, frames, strict=True)
    ]
    noisy = [k for k, end in enumerate(groups[0].ends) if end.has_noise]
    none = np.zeros(0, dtype=np.int64)
    stops = np.stack([np.concatenate([none, *(g.ends[k].stop for k in noisy)]) for g in taken])
    sigma = problem.stops.sigma[stops[0]]
    unknowns = {of: Unknown("free") for of in frames[0]}
    points = frozenset(of for of in frames[0] if widths.get(of) == 3)
    columns = sequential_columns(widths)
    return AlikePairs(
        Problem(problem.reference, (_merge_groups(taken),), unknowns, points, {}, Stops(sigma), columns),
        numbers,
        tuple(frames),
        tuple(group.camera for group in groups),
        rows,
        (np.arange(most) < np.array([[len(g)] for g in groups])).astype(float),
        np.stack(where),
        stops,
    )


def _merge_groups(groups: Sequence[ViewGroup]) -> ViewGroup:
    """The views of pairs as one group (b, n), the stops as all its entries number them."""
    stops = _stops_in_turn(groups[0])
    eye, hand = (_one_end(name, [group.ends[k] for group in groups], stops[k]) for k, name in enumerate(_NAMES))
    sample, measurement = np.stack([g.sample for g in groups]), stack([g.measurement for g in groups])
    return ViewGroup(_LENS_FIELD, "target", (eye, hand), sample, measurement, motion=groups[0].motion)


def _stops_in_turn(group: ViewGroup) -> list[IntArray]:
    """Stops of both ends, (n,): each view's own stop, those of the hand after those of the eye; -1 without noise."""
    stops, count = [], 0
    for end in group.ends:
        stops.append(np.arange(count, count + len(group)) if end.has_noise else end.stop)
        count += len(group) if end.has_noise else 0
    return stops


def _one_end(name: str, ends: Sequence[End], stop: IntArray) -> End:
    """One end of pairs, (b, n)."""
    base = None if ends[0].base is None else f"{name}_base"
    poses = SE3.stack([end.base_from_flange for end in ends])
    return replace(ends[0], mount=f"{name}_mount", base=base, base_from_flange=poses, stop=stop, joints=None)
