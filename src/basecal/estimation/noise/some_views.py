"""A problem of some of its views, from whose sigmas the search among all of them starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.geometry import IntArray


def some_views(problem: Problem, state: State, most: int) -> tuple[Problem, State]:
    """The problem of at most so many views of each group, spread evenly, and of their stops alone; the state of it."""
    groups = [g.take(np.arange(0, len(g), -(-len(g) // most))) for g in problem.groups if len(g)]
    seen = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in groups:
        seen[group.eye_stop] = seen[group.hand_stop] = True
    kept = np.flatnonzero(seen[:-1])  # the last stands for views without a stop
    row = np.full(len(seen), -1, dtype=np.int64)
    row[kept] = np.arange(len(kept))
    stops = Stops(problem.stops.sigma[kept], tuple(problem.stops.robot[k] for k in kept))
    taken = (replace(g, eye_stop=row[g.eye_stop], hand_stop=row[g.hand_stop]) for g in groups)
    return replace(problem.with_groups(taken), stops=stops), replace(state, stop_errors=state.stop_errors[kept])


def recorded_alone(problem: Problem, state: State, most: int) -> tuple[Problem, State]:
    """As `some_views`, with robots' places numbered as if nothing but these views had been recorded."""
    few, state = some_views(problem, state, most)
    stands: dict[str, list[IntArray]] = {}
    for group in few.groups:
        for robot, stand in ((group.eye, group.eye_stand), (group.hand, group.hand_stand)):
            if robot is not None:
                stands.setdefault(robot, []).append(stand)
    known = {robot: np.unique(np.concatenate(of)) for robot, of in stands.items()}

    def renumbered(robot: str | None, stand: IntArray) -> IntArray:
        """Places of a robot counted among those it takes in these views."""
        return stand if robot is None else np.searchsorted(known[robot], stand)

    taken = (
        replace(g, eye_stand=renumbered(g.eye, g.eye_stand), hand_stand=renumbered(g.hand, g.hand_stand))
        for g in few.groups
    )
    return replace(few.with_groups(taken), stands={robot: len(of) for robot, of in known.items()}), state
