"""Refinement of starts of camera-target pairs on their directions, batched over many searches.

The limits are validated by `benchmarks.starts`.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust_batch
from basecal.estimation.problem.problem import Problem, State, Stops, sequential_columns
from basecal.estimation.start.closed_form import Loop, Rotations, Triple, solve_translations
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.start.rotation_search import pose_starts, refine_rotations
from basecal.geometry import SE3
from basecal.numerics.batch import stack

_GRID_CELLS = 16  # number of cells of the grid that are refined; validated by benchmarks.starts
_REFINEMENT_STEPS = 30  # maximum number of steps: starts that need more are poor; the best is refined again later


@dataclass(frozen=True, eq=False)
class Refinement:
    """Request to refine the starts of one pair and return the best.

    Attributes:
        views: Views of the pair.
        loop: The known transforms among X, Y and Z.
        starts: Starts of X, Y and Z.
        is_point: Whether the target is a single point, whose mount has no rotation.
        searched: Whether to search for further starts over rotations; requires views with poses.
    """

    views: PairViews
    loop: Loop
    starts: Sequence[Triple]
    is_point: bool
    searched: bool = False

    @property
    def structure(self) -> Hashable:
        """Key that is equal for requests that can share a batch."""
        group = self.views.group
        points = getattr(group.measurement, "points_in_target", np.zeros((0, 3)))
        kind = type(group.measurement), points.tobytes()
        return *kind, self.loop.unknown, self.is_point, self.searched


def refine_jointly(requests: Sequence[Refinement], iterations: int = _REFINEMENT_STEPS) -> list[Triple]:
    """Refine the starts of all requests in batches, and return the best of each request."""
    best: dict[int, Triple] = {}
    for structure in dict.fromkeys(request.structure for request in requests):
        rows = [k for k, request in enumerate(requests) if request.structure == structure]
        best |= dict(zip(rows, _refine([requests[k] for k in rows], iterations), strict=True))
    return [best[k] for k in range(len(requests))]


def _refine(requests: Sequence[Refinement], iterations: int) -> list[Triple]:
    """Refine requests of one structure as a batch; requests with fewer views are padded with zero-weight views."""
    if requests[0].searched:
        requests = [
            replace(request, starts=[*request.starts, *found])
            for request, found in zip(requests, _search_starts(requests), strict=True)
        ]
    view_count = max(len(request.views.group) for request in requests)
    problems = [pair_problem(request.views, request.loop, request.is_point) for request in requests]
    rows = [np.minimum(np.arange(view_count), len(request.views.group) - 1) for request in requests]
    group = stack([p.groups[0].take(r) for p, r in zip(problems, rows, strict=True)])
    weight = np.stack([(np.arange(view_count) < len(request.views.group)).astype(np.float64) for request in requests])
    owner = np.repeat(np.arange(len(requests)), [len(request.starts) for request in requests])
    starts = [dict(zip("xyz", start, strict=True)) for request in requests for start in request.starts]
    states = State({k: SE3.stack([start[k] for start in starts]) for k in "xyz"}, {}, np.zeros((len(starts), 0, 6)))
    problem = problems[0].with_groups([group.take_batch(owner)])
    fits = bundle_adjust_batch(problem, states, dof=1, iterations=iterations, weights=[weight[owner]])
    cost, found = np.where(np.isnan(fits.cost), np.inf, fits.cost), fits.state.transforms
    own_rows = (np.flatnonzero(owner == k) for k in range(len(requests)))
    best = [rows[np.argmin(cost[rows])] for rows in own_rows]
    return [(found["x"][k], found["y"][k], found["z"][k]) for k in best]


def _search_starts(requests: Sequence[Refinement]) -> list[list[Triple]]:
    """Starts by a search over rotations, with the best pose of each view, and with both poses of ambiguous views."""
    ambiguous = {
        k: loop
        for k, request in enumerate(requests)
        if (loop := request.views.ambiguous_loop(request.loop)) is not None
    }
    found = pose_starts([*(request.loop for request in requests), *ambiguous.values()], _GRID_CELLS)
    starts = [
        [solve_translations(request.loop, rotations) for rotations in candidates]
        for request, candidates in zip(requests, found, strict=False)
    ]
    for k, candidates in zip(ambiguous, found[len(requests) :], strict=True):
        views, loop = requests[k].views, requests[k].loop
        chosen = [_choose_poses(views, loop, rotations) for rotations in candidates]
        starts[k] += [solve_translations(*each) for each in zip(chosen, candidates, strict=True)]
        settled = refine_rotations(chosen, candidates)
        starts[k] += [solve_translations(_choose_poses(views, loop, rotations), rotations) for rotations in settled]
    return starts


def _choose_poses(views: PairViews, loop: Loop, rotations: Rotations) -> Loop:
    """Loop with the pose of each view that is closest to the prediction of the rotations of X, Y and Z."""
    assert views.candidates is not None
    choice = views.closest_pose(solve_translations(loop, rotations))
    return loop._replace(b=views.candidates[np.arange(len(choice)), choice])


def pair_problem(views: PairViews, loop: Loop, is_point: bool) -> Problem:
    """Return the problem of a single pair, with transforms named x, y and z."""
    eye, hand = views.group.without_stops().ends
    ends = replace(eye, mount="x", base=None), replace(hand, mount="z", base="y")
    group = replace(views.group, ends=ends, readings=())
    columns = sequential_columns({name: 3 if name == "z" and is_point else 6 for name in loop.unknown})
    unknowns = {name: Unknown() for name in "xyz"}
    return Problem("", (group,), unknowns, frozenset(), {}, Stops(np.zeros((0, 6))), columns)
