"""Rigid transforms that bring points of one arm to those of another, where a share of their pairs is wrong.

A repeated object makes a wrong transform that many pairs agree with. So several distinct ones are given, for images to
judge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.start.pair_views import umeyama
from basecal.geometry import SE3, Array, BoolArray
from basecal.geometry.rotation import nearest_rotation

_TRIPLES = 4000  # of pairs that are tried: 97 % of all are wrong before the chance of a right triple falls below 10 %
_AT_ONCE = 500
_REFINEMENTS = 4  # of refinement on the pairs that agree
_FEWEST_PAIRS_BEYOND = 5  # pairs that agree beyond the three that define a transform
_NEAR_M, _NEAR_RAD = 0.05, 0.05  # within which two transforms are one hypothesis
_SEED = 1


@dataclass(frozen=True, eq=False)
class Alignment:
    """A transform, and which pairs of points agree with it.

    Attributes:
        second_from_first: The transform.
        agrees: (n,).
    """

    second_from_first: SE3
    agrees: BoolArray


def alignments(first: Array, second: Array, tolerance_m: Array, max_count: int) -> list[Alignment]:
    """Distinct transforms that pairs of points agree with, those of most pairs first.

    Args:
        first: (n, 3) points of the first arm [m].
        second: (n, 3) the points of the second that they are paired with [m].
        tolerance_m: (n,) how far a pair may be apart [m].
        max_count: How many to give.
    """
    if len(first) < 3 + _FEWEST_PAIRS_BEYOND:
        return []
    rng = np.random.default_rng(_SEED)
    triples = rng.integers(len(first), size=(_TRIPLES, 3))
    triples = triples[
        (triples[:, 0] != triples[:, 1]) & (triples[:, 1] != triples[:, 2]) & (triples[:, 0] != triples[:, 2])
    ]
    every = _triple_transforms(first[triples], second[triples])
    agrees = np.concatenate([_agreeing(every[some], first, second, tolerance_m) for some in _parts(len(triples))])
    is_left = np.ones(len(first), dtype=bool)
    found: list[Alignment] = []
    while len(found) < max_count:
        # A transform of fewer pairs, such as of a repeated object, shows among the pairs that others leave.
        best = int(np.argmax(agrees @ is_left.astype(np.int64)))
        refined = _refine(every[best], first, second, tolerance_m)
        if refined is None or not np.any(refined.agrees & is_left):
            break
        at = refined.second_from_first
        if not any(are_one(at, other.second_from_first, first, _NEAR_M, _NEAR_RAD) for other in found):
            found.append(refined)
        is_left &= ~refined.agrees
    return sorted(found, key=lambda each: -int(each.agrees.sum()))


def _parts(count: int) -> list[slice]:
    """Parts of so many rows, some at a time."""
    return [slice(first, first + _AT_ONCE) for first in range(0, count, _AT_ONCE)]


def _triple_transforms(first: Array, second: Array) -> SE3:
    """Transforms of triples of pairs, (t, 3, 3) each. Source: Umeyama 1991."""
    middle, other_middle = first.mean(1), second.mean(1)
    spread = (second - other_middle[:, None]).mT @ (first - middle[:, None])
    rotation = nearest_rotation(spread)
    return SE3(rotation, other_middle - (rotation @ middle[..., None])[..., 0])


def _agreeing(transforms: SE3, first: Array, second: Array, tolerance_m: Array) -> BoolArray:
    """Which pairs agree with each transform, (t, n)."""
    moved = np.einsum("tab,nb->tna", transforms.rotation, first, optimize=True) + transforms.translation[:, None]
    agrees: BoolArray = np.sum((moved - second) ** 2, -1) < tolerance_m**2
    return agrees


def _refine(transform: SE3, first: Array, second: Array, tolerance_m: Array) -> Alignment | None:
    """The transform of the pairs that agree with it; None if these are too few."""
    agrees = _agreeing(SE3.stack([transform]), first, second, tolerance_m)[0]
    for _ in range(_REFINEMENTS):
        if agrees.sum() < 3 + _FEWEST_PAIRS_BEYOND:
            return None
        weight = 1 / tolerance_m[None, agrees] ** 2
        transform = umeyama(first[agrees], second[None, agrees], weight)[0]
        agrees = _agreeing(SE3.stack([transform]), first, second, tolerance_m)[0]
    return Alignment(transform, agrees) if agrees.sum() >= 3 + _FEWEST_PAIRS_BEYOND else None


def are_one(first: SE3, second: SE3, points: Array, near_m: float, near_rad: float) -> bool:
    """Whether two transforms move the middle of the points to one place, and have one rotation."""
    middle = np.median(points, axis=0)
    apart = np.linalg.norm(first @ middle - second @ middle)
    return bool(apart < near_m and np.linalg.norm((first.inverse() @ second).rotvec) < near_rad)
