"""Closed loops of robots and cameras: what is left of the identity where relations of bases are multiplied around one.

Each pair of a camera and a target says by its own views how the two bases before it stand, lenses and robots as the
solution has them. Pairs are the edges of a graph of bases, and around each of its independent loops these relations
would close if nothing contradicted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import ClosedLoop, Unknown
from basecal.estimation.descent import descend
from basecal.estimation.noise import degrees_of_freedom
from basecal.estimation.observability import seen_directions
from basecal.estimation.problem import State, ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import SE3

_STEPS = 50


@dataclass(frozen=True, eq=False)
class _Edge:
    """`a_from_b` of two bases, by the views of one pair alone."""

    pair: str
    a: str
    b: str
    a_from_b: SE3

    def turned(self) -> _Edge:
        return _Edge(self.pair, self.b, self.a, self.a_from_b.inverse())


def closed_loops(solution: Solution) -> tuple[ClosedLoop, ...]:
    """Every independent loop that pairs of cameras and targets close; none where there is but one pair."""
    if len(solution.problem.groups) < 2:
        return ()
    found = (_edge(solution, group) for group in solution.problem.groups if len(group))
    edges = [edge for edge in found if edge is not None and edge.a != edge.b]
    way: dict[str, list[_Edge]] = {}
    used: set[int] = set()
    for start in dict.fromkeys(edge.a for edge in edges):
        if start not in way:
            way[start] = []
            used |= _grow(way, edges, start)
    return tuple(_loop(way, edge) for k, edge in enumerate(edges) if k not in used)


def _grow(way: dict[str, list[_Edge]], edges: list[_Edge], start: str) -> set[int]:
    """Add the way from `start` to every base that edges lead to; the edges on these ways."""
    used, waiting = set(), [start]
    while waiting:
        here = waiting.pop(0)
        for k, edge in enumerate(edges):
            step = edge if edge.a == here else edge.turned() if edge.b == here else None
            if step is not None and step.b not in way:
                way[step.b] = [*way[here], step]
                waiting.append(step.b)
                used.add(k)
    return used


def _loop(way: dict[str, list[_Edge]], edge: _Edge) -> ClosedLoop:
    """The loop that an edge closes: out to its one end, along it, and back from the other, common ways left out."""
    out, back = way[edge.a], way[edge.b]
    while out and back and out[0] is back[0]:
        out, back = out[1:], back[1:]
    steps = [*out, edge, *(step.turned() for step in reversed(back))]
    around = SE3.identity()
    for step in steps:
        around = around @ step.a_from_b
    off = around.translation, around.rotvec
    length, angle = (float(np.linalg.norm(each)) for each in off)
    return ClosedLoop(tuple(step.a for step in steps), tuple(step.pair for step in steps), length, angle)


def _edge(solution: Solution, group: ViewGroup) -> _Edge | None:
    """The relation of a pair's bases by its own views, its mounts free too where these show them; None if not seen."""
    base = group.hand_base or group.eye_base
    if base is None:
        return None
    mounts = [name for name in (group.camera_mount, group.target_mount) if name in solution.problem.columns]
    state = _alone(solution, group, base, mounts) or _alone(solution, group, base, [])
    if state is None:
        return None
    eye, hand = (_world_from(state, name) for name in (group.eye_base, group.hand_base))
    reference = f"{solution.problem.reference}_base"
    a, b = (reference if name is None else name.split("_from_")[1] for name in (group.eye_base, group.hand_base))
    return _Edge(f"{group.camera} > {group.target}", a, b, eye.inverse() @ hand)


def _alone(solution: Solution, group: ViewGroup, base: str, mounts: list[str]) -> State | None:
    """The state that fits one pair best, of a base and mounts, the base's prior left out; None where it is not seen."""
    whole = solution.problem
    widths = {name: whole.columns[name].stop - whole.columns[name].start for name in mounts} | {base: 6}
    ends = np.cumsum([0, *widths.values()])
    columns = {name: slice(int(i), int(j)) for name, i, j in zip(widths, ends[:-1], ends[1:], strict=True)}
    problem = replace(whole, groups=(group,), columns=columns, unknowns={**whole.unknowns, base: Unknown()})
    end = descend(problem, solution.state, degrees_of_freedom(problem), _STEPS)
    seen = seen_directions(problem, end.state, end.normal.hessian, solution.noise.factor)
    return end.state if end.converged and base not in seen.blind else None


def _world_from(state: State, base: str | None) -> SE3:
    return SE3.identity() if base is None else state.transforms[base]
