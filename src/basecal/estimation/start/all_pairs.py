"""Many bases and what their robots carry, placed by all pairs of camera and target at once.

One after another they drift: what the last pairs of a long ring see may lie behind their cameras then. Here each pair
is refined alone, all of them side by side; bases go where all pairs agree best, those that close loops among them.
`benchmarks.ring` judges its limits.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem
from basecal.estimation.start.base_graph import Relation, placed_by_all
from basecal.estimation.start.closed_form import solve_translations
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.start.refinement import Refinement, Triple, refine_jointly
from basecal.estimation.start.rotation_search import settled_rotations
from basecal.geometry import SE3, Array, BoolArray

_LONG_RING_BASES = 8  # bases: of fewer none drifts farther than a descent mends
_WRONG_RATIO = 4.0  # over the median of pairs: noise does not make one fit so badly


def placed_by_pairs(
    problem: Problem, sights: Sequence[PairViews], transforms: Mapping[str, SE3], known_names: Collection[str]
) -> dict[str, SE3]:
    """Free bases and mounts where all pairs have them; nothing if bases are few, or some of them are known.

    Args:
        problem: The problem.
        sights: Its pairs.
        transforms: Where everything is about.
        known_names: Names of what is known and stays.
    """
    bases = {end.base for s in sights for end in s.group.ends if end.base is not None}
    if len(bases) < _LONG_RING_BASES or bases & set(known_names):
        return {}
    seen = [s for s in sights if s.candidates is not None and s.group.eye.base != s.group.hand.base]
    triples = _refine_pairs(problem, seen, transforms, known_names)
    misfit = np.array([_misfit(sight, triple) for sight, triple in zip(seen, triples, strict=True)])
    right = _accepted_pairs(misfit)
    told = [Relation(seen[k].group.eye.base, seen[k].group.hand.base, triples[k][1]) for k in np.flatnonzero(right)]
    placed = _chain_bases(told)
    if placed.keys() < bases:
        return {}
    mounts: dict[str, SE3] = {}
    for k in np.argsort(-misfit):  # the best last, and so kept
        mounts[seen[k].group.eye.mount], mounts[seen[k].group.hand.mount] = triples[k][0], triples[k][2]
    free = {name: pose for name, pose in mounts.items() if name not in known_names}
    return free | placed_by_all(placed, told)


def _refine_pairs(
    problem: Problem, views: Sequence[PairViews], transforms: Mapping[str, SE3], known_names: Collection[str]
) -> list[Triple]:
    """X, Y and Z of each pair, refined alone; where one fits much worse than others, its rotations are searched."""
    wishes = _restart_pairs([_make_refinement(problem, sight, transforms, known_names) for sight in views])
    triples = refine_jointly(wishes)
    misfit = np.array([_misfit(sight, triple) for sight, triple in zip(views, triples, strict=True)])
    bad = [int(k) for k in np.flatnonzero(~_accepted_pairs(misfit))]
    again = [Refinement(w.views, w.loop, w.starts, w.is_point, searched=True) for w in (wishes[k] for k in bad)]
    for k, triple in zip(bad, refine_jointly(again), strict=True):
        if _misfit(views[k], triple) < misfit[k]:
            triples[k] = triple
    return triples


def _make_refinement(
    problem: Problem, sight: PairViews, transforms: Mapping[str, SE3], known_names: Collection[str]
) -> Refinement:
    g = sight.group
    x, z = transforms[g.eye.mount], transforms[g.hand.mount]
    triple = (x, g.eye_base_from_hand_base(transforms), z)
    known_x, known_z = (transforms[end.mount] if end.mount in known_names else None for end in g.ends)
    loop = sight.loop(known_x, None, known_z, sight.closest_pose(triple))
    return Refinement(sight, loop, [triple], g.hand.mount in problem.point_mounts)


def _restart_pairs(wishes: Sequence[Refinement]) -> list[Refinement]:
    """Restart from where a pair's own samples lead: if the chain drifted, a descent alone would go astray."""
    settled = list(wishes)
    for unknown in {wish.loop.unknown for wish in wishes}:
        numbers = [k for k, wish in enumerate(wishes) if wish.loop.unknown == unknown]
        some = [wishes[k] for k in numbers]
        near = [[end.rotation for end in wish.starts[0]] for wish in some]
        turns = settled_rotations([wish.loop for wish in some], near)
        for k, wish, turn in zip(numbers, some, turns, strict=True):
            settled[k] = replace(wish, starts=[solve_translations(wish.loop, turn)])
    return settled


def _misfit(sight: PairViews, triple: Triple) -> float:
    """How far a pair's views are turned from where X, Y and Z have them, the median [rad]."""
    assert sight.candidates is not None
    chosen = sight.closest_pose(triple)
    own = sight.candidates[np.arange(len(chosen)), chosen]
    off = (own.inverse() @ sight.predict_poses(triple)).rotvec
    found = float(np.median(np.linalg.norm(off, axis=-1)))
    return found if np.isfinite(found) else np.inf


def _accepted_pairs(misfit: Array) -> BoolArray:
    return np.asarray(misfit <= _WRONG_RATIO * np.median(misfit))


def _chain_bases(relations: Sequence[Relation]) -> dict[str, SE3]:
    """Where bases stand in the world by the fewest relations that lead to them."""
    near: dict[str | None, list[tuple[str | None, SE3]]] = defaultdict(list)
    for of in relations:
        near[of.eye_base].append((of.hand_base, of.eye_base_from_hand_base))
        near[of.hand_base].append((of.eye_base, of.eye_base_from_hand_base.inverse()))
    placed: dict[str | None, SE3] = {None: SE3.identity()}
    waiting: list[str | None] = [None]
    for name in waiting:  # grows
        for other, from_other in near[name]:
            if other not in placed:
                placed[other] = placed[name] @ from_other
                waiting.append(other)
    return {name: pose for name, pose in placed.items() if name is not None}
