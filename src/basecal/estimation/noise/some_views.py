"""A problem of some of its views, from whose sigmas the search among all of them starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End


def some_views(problem: Problem, state: State, max_count: int) -> tuple[Problem, State]:
    """The problem of at most so many views of each group, spread evenly, and of their stops alone; the state of it.

    Views of the scene are left out.
    """
    groups = [g.take(np.arange(0, len(g), -(-len(g) // max_count))) for g in problem.groups if len(g)]
    seen = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in groups:
        for end in group.ends:
            seen[end.stop] = True
    kept = np.flatnonzero(seen[:-1])  # the last stands for views without a stop
    row = np.full(len(seen), -1, dtype=np.int64)
    row[kept] = np.arange(len(kept))
    stops = Stops(problem.stops.sigma[kept], tuple(problem.stops.robot[k] for k in kept))
    taken = (group.with_ends(lambda end: replace(end, stop=row[end.stop])) for group in groups)
    return replace(problem.with_groups(taken), stops=stops, tied=None), replace(
        state, stop_errors=state.stop_errors[kept]
    )


def recorded_subset(problem: Problem, state: State, max_count: int) -> tuple[Problem, State]:
    """As `some_views`, with robots' places numbered as if nothing but these views had been recorded."""
    few, state = some_views(problem, state, max_count)
    known = {r: np.unique(np.concatenate([end.stand for end in few.robot_ends(r)])) for r in few.robots}

    def renumber(end: End) -> End:
        """An end whose stops are counted among those of its robot in these views."""
        return end if end.robot is None else replace(end, stand=np.searchsorted(known[end.robot], end.stand))

    taken = (group.with_ends(renumber) for group in few.groups)
    return replace(few.with_groups(taken), stands={robot: len(of) for robot, of in known.items()}), state
