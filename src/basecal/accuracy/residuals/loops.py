"""Every closed loop of robots and cameras: how far from closing it is.

Each view closes a loop through one camera and one target. Several pairs of camera and target may relate the same bases,
directly or around a ring. Each pair then gives the relative pose of its two bases by its own views alone. Its mounts
are estimated again if these views determine them. The product of these poses around the ring should be the identity.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Loop, SampleResidual, Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.noise.robot_noise import some_views
from basecal.estimation.observability.observability import analyse_observability
from basecal.estimation.problem.problem import Problem, State, sequential_columns
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import SE3

_PAIR_FIT_STEPS = 50  # of a pair's own fit, which starts at the fit to all; assumed: bounds the time


@dataclass(frozen=True, eq=False)
class _Relation:
    """Two bases as the views of one pair of camera and target relate them, lenses and robots as in the solution."""

    start: str
    end: str
    path: tuple[str, ...]
    start_from_end: SE3
    views: int

    def reverse(self) -> _Relation:
        """The loop from its other end."""
        return _Relation(self.end, self.start, self.path[::-1], self.start_from_end.inverse(), self.views)


def loops(solution: Solution, residuals: Sequence[SampleResidual]) -> tuple[Loop, ...]:
    """The loops of every pair of camera and target, rms over its views, and those around rings of bases.

    Args:
        solution: What was found.
        residuals: The residuals of its views.
    """
    bases = {(g.camera, g.target): _bases(solution.problem, g) for g in solution.problem.groups}
    of_pairs: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for r in residuals:
        if r.loop_m is not None and r.loop_rad is not None:
            of_pairs[r.camera, r.target].append((r.loop_m, r.loop_rad))
    found = []
    for pair, (eye_base, hand_base) in bases.items():
        closed = np.array(of_pairs[pair])
        if len(closed):
            rms_m, rms_rad = np.sqrt(np.mean(closed**2, axis=0))
            found.append(Loop((eye_base, *pair, hand_base), len(closed), float(rms_m), float(rms_rad)))
    return (*found, *_ring_loops(solution))


def _bases(problem: Problem, group: ViewGroup) -> tuple[str, str]:
    """The bases of the camera's robot and of the target's; `world` counts from the reference's."""
    eye, hand = (end.robot or problem.reference for end in group.ends)
    return f"{eye}_base", f"{hand}_base"


def _ring_loops(solution: Solution) -> list[Loop]:
    """One loop for each pair of camera and target beyond those that a tree over the bases needs."""
    if len(solution.problem.groups) < 2:
        return []
    way: dict[str, list[_Relation]] = {f"{solution.problem.reference}_base": []}
    waiting, found = _relations(solution), []
    while waiting:
        relation = next((r for r in waiting if r.start in way or r.end in way), None)
        if relation is None:
            break
        waiting.remove(relation)
        forward = relation if relation.start in way else relation.reverse()
        if forward.end in way:
            back = [step.reverse() for step in reversed(way[forward.end])]
            found.append(_close_loop([*way[forward.start], forward, *back]))
        else:
            way[forward.end] = [*way[forward.start], forward]
    return found


def _close_loop(steps: Sequence[_Relation]) -> Loop:
    """The loop of steps one after another; one taken forth and back, at its ends, is left out."""
    while len(steps) > 2 and steps[0].path == steps[-1].path[::-1]:
        steps = steps[1:-1]
    around = SE3.identity()
    for step in steps:
        around = around @ step.start_from_end
    path = (*steps[0].path, *(name for step in steps[1:] for name in step.path[1:]))
    off = around.log()
    return Loop(
        path,
        sum(step.views for step in steps),
        float(np.linalg.norm(around.translation)),
        float(np.linalg.norm(off[3:])),
    )


def _relations(solution: Solution) -> list[_Relation]:
    """The relation of each pair between two different bases, if its own views determine it."""
    relations = []
    for group in solution.problem.groups:
        start, end = _bases(solution.problem, group)
        base = group.hand.base or group.eye.base
        if start == end or base is None or not len(group):
            continue
        mounts = [end.mount for end in group.ends if end.mount in solution.problem.columns]
        state = _fit_pair(solution, group, base, mounts) or _fit_pair(solution, group, base, [])
        if state is not None:
            path = (start, group.camera, group.target, end)
            relations.append(_Relation(start, end, path, group.eye_base_from_hand_base(state.transforms), len(group)))
    return relations


def _fit_pair(solution: Solution, group: ViewGroup, base: str, mounts: Sequence[str]) -> State | None:
    """The state that fits one pair best, of a base and mounts, the base's prior left out; None if it is not seen."""
    whole, state = some_views(solution.problem.with_groups([group]), solution.state, len(group))
    columns = sequential_columns({name: whole.column_width(name) for name in mounts} | {base: 6})
    problem = replace(whole, columns=columns, unknowns={**whole.unknowns, base: Unknown()}, models={})
    end = bundle_adjust(problem, state, degrees_of_freedom(problem), _PAIR_FIT_STEPS)
    observability = analyse_observability(problem, end.state, end.normal.hessian, solution.noise.factor)
    return end.state if end.converged and base not in observability.unobservable else None
