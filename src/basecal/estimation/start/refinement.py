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
from basecal.estimation.start.rotation_search import pose_starts, settled_rotations
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


def refine_jointly(wishes: Sequence[Refinement], iterations: int = _REFINEMENT_STEPS) -> list[Triple]:
    """Refine the starts of all requests in batches, and return the best of each request."""
    best: dict[int, Triple] = {}
    for structure in dict.fromkeys(wish.structure for wish in wishes):
        numbers = [k for k, wish in enumerate(wishes) if wish.structure == structure]
        best |= dict(zip(numbers, _refine([wishes[k] for k in numbers], iterations), strict=True))
    return [best[k] for k in range(len(wishes))]


def _refine(wishes: Sequence[Refinement], iterations: int) -> list[Triple]:
    """Refine requests of one structure as a batch; requests with fewer views are padded with zero-weight views."""
    if wishes[0].searched:
        wishes = [replace(w, starts=[*w.starts, *of]) for w, of in zip(wishes, _search_starts(wishes), strict=True)]
    most = max(len(wish.views.group) for wish in wishes)
    problems = [pair_problem(wish.views, wish.loop, wish.is_point) for wish in wishes]
    rows = [np.minimum(np.arange(most), len(wish.views.group) - 1) for wish in wishes]
    group = stack([p.groups[0].take(r) for p, r in zip(problems, rows, strict=True)])
    weight = np.stack([(np.arange(most) < len(wish.views.group)).astype(np.float64) for wish in wishes])
    owner = np.repeat(np.arange(len(wishes)), [len(wish.starts) for wish in wishes])
    starts = [dict(zip("xyz", start, strict=True)) for wish in wishes for start in wish.starts]
    states = State({k: SE3.stack([start[k] for start in starts]) for k in "xyz"}, {}, np.zeros((len(starts), 0, 6)))
    together = problems[0].with_groups([group.take_batch(owner)])
    ends = bundle_adjust_batch(together, states, dof=1, iterations=iterations, weights=[weight[owner]])
    cost, of = np.where(np.isnan(ends.cost), np.inf, ends.cost), ends.state.transforms
    own = (np.flatnonzero(owner == k) for k in range(len(wishes)))
    best = [rows[np.argmin(cost[rows])] for rows in own]
    return [(of["x"][k], of["y"][k], of["z"][k]) for k in best]


def _search_starts(wishes: Sequence[Refinement]) -> list[list[Triple]]:
    """Starts by a search over rotations, with the best pose of each view, and with both poses of ambiguous views."""
    both = {k: loop for k, wish in enumerate(wishes) if (loop := wish.views.ambiguous_loop(wish.loop)) is not None}
    found = pose_starts([*(wish.loop for wish in wishes), *both.values()], _GRID_CELLS)
    starts = [[solve_translations(wish.loop, turn) for turn in of] for wish, of in zip(wishes, found, strict=False)]
    for k, of in zip(both, found[len(wishes) :], strict=True):
        views, loop = wishes[k].views, wishes[k].loop
        chosen = [_choose_poses(views, loop, turn) for turn in of]
        starts[k] += [solve_translations(*each) for each in zip(chosen, of, strict=True)]
        settled = settled_rotations(chosen, of)
        starts[k] += [solve_translations(_choose_poses(views, loop, each), each) for each in settled]
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
