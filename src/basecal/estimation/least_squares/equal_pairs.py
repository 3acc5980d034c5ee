"""Pairs of camera and target with the same structure, batched; each pair depends on a few unknowns of its own.

A cell of a hundred robots has hundreds of pairs. In a batch, their linearisation has no overhead per pair.
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
"""Maximum number of views of a batch: larger batches are no faster and exceed the cache; see `benchmarks.robots`."""

_CAMERA_ROLE = "camera"
_END_NAMES = ("eye", "hand")  # names of the two ends


@dataclass(frozen=True, eq=False)
class PairBatch:
    """Batch of pairs of the same structure.

    Attributes:
        problem: One group of views (b, n), whose unknowns are named by roles such as `eye_mount`.
        groups: (b,) indices of the pairs' groups in the cell's problem.
        names: Names of each pair's transforms, by role.
        cameras: Name of each pair's camera.
        rows: (b, n) views in the pair's group, padded with its first view.
        weight: (b, n) 1 for views, 0 for padding.
        columns: (b, m) columns of the pair's unknowns in the cell's problem.
        stops: (b, 2 n) stops of eye and hand; (b, n) if only one of them has noise, (b, 0) if neither has.
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
    def _roles(self) -> tuple[str, ...]:
        return tuple(self.names[0])

    def state(self, state: State) -> State:
        """Extract the states of the pairs, (b,), from the state of the cell."""
        transforms = {role: SE3.stack([state.transforms[names[role]] for names in self.names]) for role in self._roles}
        cameras: dict[str, Camera] = {}
        if self.cameras[0] in state.cameras:
            lenses = [state.cameras[name] for name in self.cameras]
            cameras[_CAMERA_ROLE] = lenses[0].with_parameters(np.stack([lens.parameters for lens in lenses]))
        return State(transforms, cameras, state.stop_errors[self.stops])

    def linearise(self, states: State, weights: Sequence[Array] | None) -> NormalEquations:
        """Expand the pairs to second order, (b,); weights of views are by the cell's groups, all 1 if None."""
        weight = self.weight
        if weights is not None:
            weight = weight * np.stack([weights[g][row] for g, row in zip(self.groups, self.rows, strict=True)])
        # Without padding and with unit weights, None saves time; this is the usual case.
        return linearise(self.problem, states, None if weight.all() and np.all(weight == 1) else [weight])

    def stop_errors(self, states: State, model: NormalEquations, step: Array) -> Array:
        """Errors of the pairs' stops, (b, 2 n, 6), after a step of all columns (p,)."""
        return retract(self.problem, states, model, step[self.columns]).stop_errors


def group_pairs(problem: Problem) -> tuple[PairBatch, ...]:
    """Group the pairs of a cell by structure; all stops with noise must be private."""
    by_structure: dict[Hashable, list[int]] = defaultdict(list)
    for number, group in enumerate(problem.groups):
        if len(group):
            by_structure[_structure(problem, group)].append(number)
    return tuple(
        _join_pairs(problem, part) for numbers in by_structure.values() for part in _split_by_size(problem, numbers)
    )


def _split_by_size(problem: Problem, numbers: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Split pairs of one structure into parts of at most `MOST_VIEWS` views, or of a single pair."""
    part: list[int] = []
    for number in numbers:
        if part and (len(part) + 1) * max(len(problem.groups[k]) for k in (*part, number)) > MOST_VIEWS:
            yield tuple(part)
            part = []
        part.append(number)
    yield tuple(part)


def _structure(problem: Problem, group: ViewGroup) -> Hashable:
    """Key that is equal for pairs of the same structure."""
    points = getattr(group.measurement, "points_in_target", np.zeros((0, 3)))
    lens = problem.lenses.get(group.camera)
    widths = tuple((role, problem.column_width(name)) for role, name in _frames(group).items())
    # Sigmas are stored for each stop; all stops of a robot have the same.
    sigmas = tuple(problem.stops.sigma[end.stop[0]].tobytes() if end.has_noise else b"" for end in group.ends)
    is_static = tuple(end.robot is None for end in group.ends)
    lens_key = (lens is not None, problem.column_width(group.camera))
    return type(group.measurement), points.tobytes(), is_static, widths, lens_key, sigmas


def _frames(group: ViewGroup) -> dict[str, str]:
    """Names of a group's transforms, by their role in a pair."""
    frames = {}
    for name, end in zip(_END_NAMES, group.ends, strict=True):
        frames[f"{name}_mount"] = end.mount
        if end.base is not None:
            frames[f"{name}_base"] = end.base
    return frames


def _join_pairs(problem: Problem, numbers: tuple[int, ...]) -> PairBatch:
    groups = [problem.groups[number] for number in numbers]
    frames = [_frames(group) for group in groups]
    view_count = max(map(len, groups))
    rows = np.stack([np.where(np.arange(view_count) < len(g), np.arange(view_count), 0) for g in groups])
    padded = [group.take(row) for group, row in zip(groups, rows, strict=True)]
    unknown_names = {**frames[0], _CAMERA_ROLE: groups[0].camera}
    widths = {role: problem.column_width(name) for role, name in unknown_names.items() if name in problem.columns}
    pair_columns = [
        np.r_[tuple(problem.columns[names.get(role, group.camera)] for role in widths)]
        for group, names in zip(groups, frames, strict=True)
    ]
    noisy = [k for k, end in enumerate(groups[0].ends) if end.has_noise]
    no_stops = np.zeros(0, dtype=np.int64)
    stops = np.stack([np.concatenate([no_stops, *(g.ends[k].stop for k in noisy)]) for g in padded])
    sigma = problem.stops.sigma[stops[0]]
    unknowns = {role: Unknown("free") for role in frames[0]}
    points = frozenset(role for role in frames[0] if widths.get(role) == 3)
    columns = sequential_columns(widths)
    return PairBatch(
        Problem(problem.reference, (_merge_groups(padded),), unknowns, points, {}, Stops(sigma), columns),
        numbers,
        tuple(frames),
        tuple(group.camera for group in groups),
        rows,
        (np.arange(view_count) < np.array([[len(g)] for g in groups])).astype(float),
        np.stack(pair_columns),
        stops,
    )


def _merge_groups(groups: Sequence[ViewGroup]) -> ViewGroup:
    """Merge the views of pairs into one group (b, n), with the same stop numbers for all pairs."""
    stops = _consecutive_stops(groups[0])
    eye, hand = (_merge_ends(name, [group.ends[k] for group in groups], stops[k]) for k, name in enumerate(_END_NAMES))
    sample, measurement = np.stack([g.sample for g in groups]), stack([g.measurement for g in groups])
    return ViewGroup(_CAMERA_ROLE, "target", (eye, hand), sample, measurement, motion=groups[0].motion)


def _consecutive_stops(group: ViewGroup) -> list[IntArray]:
    """Stop numbers of both ends, (n,) each: one for each view, first the eye's, then the hand's; -1 without noise."""
    stops, count = [], 0
    for end in group.ends:
        stops.append(np.arange(count, count + len(group)) if end.has_noise else end.stop)
        count += len(group) if end.has_noise else 0
    return stops


def _merge_ends(name: str, ends: Sequence[End], stop: IntArray) -> End:
    """Merge one end of several pairs, (b, n)."""
    base = None if ends[0].base is None else f"{name}_base"
    poses = SE3.stack([end.base_from_flange for end in ends])
    return replace(ends[0], mount=f"{name}_mount", base=base, base_from_flange=poses, stop=stop, joints=None)
