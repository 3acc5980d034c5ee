"""Start values of many robot bases and mounts from all pairs of camera and target.

Placed one after another, bases accumulate errors: targets of the last pairs in a long ring may then lie behind their
cameras. Here each pair is refined alone, in one batch. The shortest chains of pairs then place the bases.
The thresholds are validated by `benchmarks.ring`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem
from basecal.estimation.start.closed_form import Rotations, Triple, solve_translations
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.estimation.start.rotation_search import rotation_angle, settled_rotations
from basecal.geometry import SE3

_LONG_RING_BASES = 8  # minimum number of bases: with fewer, a descent corrects the accumulated errors
_WRONG_RATIO = 4.0  # ratio of a pair's error to the median of all pairs that noise does not cause


def placed_by_pairs(
    problem: Problem, sights: Sequence[PairViews], transforms: Mapping[str, SE3], known_names: Collection[str]
) -> dict[str, SE3]:
    """Place free bases and mounts by all pairs; empty with few bases, or if some of them are known.

    Args:
        problem: The problem.
        sights: The pairs of the problem.
        transforms: Approximate values of all transforms.
        known_names: Names of the transforms that are known and stay unchanged.
    """
    bases = {end.base for s in sights for end in s.group.ends if end.base is not None}
    if len(bases) < _LONG_RING_BASES or bases & set(known_names):
        return {}
    seen = [s for s in sights if s.candidates is not None and s.group.eye.base != s.group.hand.base]
    triples = refine_jointly(_restart_pairs([_make_refinement(problem, s, transforms, known_names) for s in seen]))
    misfit = np.array([_misfit(sight, triple) for sight, triple in zip(seen, triples, strict=True)])
    mounts, relations = dict[str, SE3](), dict[tuple[str | None, str | None], SE3]()
    for k in np.argsort(-misfit):  # the best last, so that it overwrites the others
        eye, hand = seen[k].group.ends
        mounts[eye.mount], between, mounts[hand.mount] = triples[k]
        if misfit[k] <= _WRONG_RATIO * np.median(misfit):
            relations[eye.base, hand.base] = between
    placed = place_bases({}, relations)
    if placed.keys() < bases:
        return {}
    return {name: pose for name, pose in mounts.items() if name not in known_names} | placed


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
    """Restart pairs from rotations of their own samples: accumulated errors would lead a descent to a wrong optimum."""
    settled = list(wishes)
    for unknown in {wish.loop.unknown for wish in wishes}:
        numbers = [k for k, wish in enumerate(wishes) if wish.loop.unknown == unknown]
        some = [wishes[k] for k in numbers]
        near = [Rotations(x.rotation, y.rotation, z.rotation) for x, y, z in (wish.starts[0] for wish in some)]
        turns = settled_rotations([wish.loop for wish in some], near)
        for k, wish, turn in zip(numbers, some, turns, strict=True):
            settled[k] = replace(wish, starts=[solve_translations(wish.loop, turn)])
    return settled


def _misfit(sight: PairViews, triple: Triple) -> float:
    """Median angle between a pair's measured rotations and the prediction of X, Y and Z [rad]."""
    assert sight.candidates is not None
    chosen = sight.closest_pose(triple)
    own = sight.candidates[np.arange(len(chosen)), chosen]
    found = float(np.median(rotation_angle(own.rotation, sight.group.close_loop(*triple).rotation)))
    return found if np.isfinite(found) else np.inf


Relations = Mapping[tuple[str | None, str | None], SE3]
"""`eye_base_from_hand_base` of pairs, by the names of both bases; None is the reference."""


def place_bases(bases: Mapping[str, SE3], relations: Relations) -> dict[str, SE3]:
    """Poses of bases in the world: the given ones, and all that are connected to them or to the reference."""
    near: dict[str | None, list[tuple[str | None, SE3]]] = defaultdict(list)
    for (eye, hand), eye_from_hand in relations.items():
        near[eye].append((hand, eye_from_hand))
        near[hand].append((eye, eye_from_hand.inverse()))
    placed = dict[str | None, SE3]([(None, SE3.identity()), *bases.items()])
    waiting = [*placed]
    for name in waiting:  # grows
        for other, from_other in near[name]:
            if other not in placed:
                placed[other] = placed[name] @ from_other
                waiting.append(other)
    return {name: pose for name, pose in placed.items() if name is not None}
