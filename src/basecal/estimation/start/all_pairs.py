"""Start values of many robot bases and mounts from all pairs of camera and target.

Placed one after another, bases accumulate errors: targets of the last pairs in a long ring may then lie behind their
cameras. Here each pair is refined alone, in one batch, and searched again if it fits badly. A pose graph of all pairs
then places the bases.
The thresholds are validated by `benchmarks.ring`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.problem.problem import Problem
from basecal.estimation.start.closed_form import Rotations, Triple, solve_translations
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.start.pose_graph import adjust_bases, place_bases
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.estimation.start.rotation_search import refine_rotations, rotation_angle
from basecal.geometry import SE3, Array, BoolArray

_LONG_RING_BASES = 8  # minimum number of bases: with fewer, a descent corrects the accumulated errors
_WRONG_RATIO = 4.0  # ratio of a pair's error to the median of all pairs that noise does not cause
_SEARCH_STEPS = 100  # maximum number of steps: starts from five samples need more than 30


def place_by_pairs(
    problem: Problem, pairs: Sequence[PairViews], transforms: Mapping[str, SE3], known_names: Collection[str]
) -> dict[str, SE3]:
    """Place free bases and mounts by all pairs; empty with few bases, or if some of them are known.

    Args:
        problem: The problem.
        pairs: The pairs of the problem.
        transforms: Approximate values of all transforms.
        known_names: Names of the transforms that are known and stay unchanged.
    """
    bases = {end.base for s in pairs for end in s.group.ends if end.base is not None}
    if len(bases) < _LONG_RING_BASES or bases & set(known_names):
        return {}
    posed_pairs = [s for s in pairs if s.candidates is not None and s.group.eye.base != s.group.hand.base]
    triples, misfit = _refine_pairs([_make_refinement(problem, s, transforms, known_names) for s in posed_pairs])
    is_wrong = _is_wrong(misfit)
    mounts, relations = dict[str, SE3](), dict[tuple[str | None, str | None], SE3]()
    for k in np.argsort(-misfit):  # the best last, so that it overwrites the others
        eye, hand = posed_pairs[k].group.ends
        mounts[eye.mount], relation, mounts[hand.mount] = triples[k]
        if not is_wrong[k]:
            relations[eye.base, hand.base] = relation
    placed = place_bases({}, relations)
    if placed.keys() < bases:
        return {}
    free = {name: pose for name, pose in mounts.items() if name not in known_names}
    return free | adjust_bases(placed, relations)


def _refine_pairs(requests: Sequence[Refinement]) -> tuple[list[Triple], Array]:
    """Refine each pair alone; rotations of pairs that fit much worse than the others are searched.

    Returns:
        X, Y and Z of each pair, and its misfit [rad], (pairs,).
    """
    requests = _restart_pairs(requests)
    triples = refine_jointly(requests)
    misfit = np.array([_misfit(request.views, triple) for request, triple in zip(requests, triples, strict=True)])
    rows = np.flatnonzero(_is_wrong(misfit)).tolist()
    searched = refine_jointly([replace(requests[k], searched=True) for k in rows], _SEARCH_STEPS)
    for k, triple in zip(rows, searched, strict=True):
        if (found := _misfit(requests[k].views, triple)) < misfit[k]:
            triples[k], misfit[k] = triple, found
    return triples, misfit


def _is_wrong(misfit: Array) -> BoolArray:
    """Pairs whose misfit noise does not cause, (pairs,); those without a finite misfit are among them."""
    return np.asarray((misfit > _WRONG_RATIO * np.median(misfit)) | np.isinf(misfit))


def _make_refinement(
    problem: Problem, pair: PairViews, transforms: Mapping[str, SE3], known_names: Collection[str]
) -> Refinement:
    group = pair.group
    x, z = transforms[group.eye.mount], transforms[group.hand.mount]
    triple = (x, group.eye_base_from_hand_base(transforms), z)
    known_x, known_z = (transforms[end.mount] if end.mount in known_names else None for end in group.ends)
    loop = pair.loop(known_x, None, known_z, pair.closest_pose(triple))
    return Refinement(pair, loop, [triple], group.hand.mount in problem.point_mounts)


def _restart_pairs(requests: Sequence[Refinement]) -> list[Refinement]:
    """Restart pairs from rotations of their own samples: accumulated errors would lead a descent to a wrong optimum."""
    restarted = list(requests)
    for unknown in {request.loop.unknown for request in requests}:
        rows = [k for k, request in enumerate(requests) if request.loop.unknown == unknown]
        batch = [requests[k] for k in rows]
        starts = [Rotations(x.rotation, y.rotation, z.rotation) for x, y, z in (request.starts[0] for request in batch)]
        refined = refine_rotations([request.loop for request in batch], starts)
        for k, request, rotations in zip(rows, batch, refined, strict=True):
            restarted[k] = replace(request, starts=[solve_translations(request.loop, rotations)])
    return restarted


def _misfit(pair: PairViews, triple: Triple) -> float:
    """Median angle between a pair's measured rotations and the prediction of X, Y and Z [rad]."""
    assert pair.candidates is not None
    chosen = pair.closest_pose(triple)
    measured = pair.candidates[np.arange(len(chosen)), chosen]
    angle = float(np.median(rotation_angle(measured.rotation, pair.group.close_loop(*triple).rotation)))
    return angle if np.isfinite(angle) else np.inf
