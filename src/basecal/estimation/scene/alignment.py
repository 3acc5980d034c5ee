"""Rigid transforms that bring points of one arm to those of another, where a share of their pairs is wrong.

A repeated object makes a wrong transform that many pairs agree with. So several distinct ones are given, for images to
judge, and refined on image points that one arm shows of the other's points. `benchmarks.scene` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.views import Tracks
from basecal.estimation.start.pair_views import umeyama
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.numerics.robust_step import STEP, robust_step

_TRIPLES = 4000  # of pairs that are tried: 97 % of all are wrong before the chance of a right triple falls below 10 %
_AT_ONCE = 500
_REFINEMENTS = 4  # of refinement on the pairs that agree
_FEWEST_PAIRS = 8  # that agree, five beyond the three that define a transform
_SAME_M_RAD = 0.05  # [m, rad] within which two transforms are one hypothesis
_SEED = 1  # any other would do
_TAIL_PX = 3.0  # [px] from which on an image point counts less
_MOST_STEPS = 10


def alignments(first: Array, second: Array, tolerance_m: Array, max_count: int) -> list[tuple[SE3, BoolArray]]:
    """Distinct `second_from_first` and which pairs of points agree with them, (n,), those of most pairs first.

    Args:
        first: (n, 3) points of the first arm [m].
        second: (n, 3) the points of the second that they are paired with [m].
        tolerance_m: (n,) how far a pair may be apart [m].
        max_count: How many to give.
    """
    if len(first) < _FEWEST_PAIRS:
        return []
    triples = np.random.default_rng(_SEED).integers(len(first), size=(_TRIPLES, 3))
    triples = triples[(np.diff(np.sort(triples, axis=1)) > 0).all(1)]
    every = umeyama(first[triples], second[triples], np.ones(triples.shape))
    parts = [slice(at, at + _AT_ONCE) for at in range(0, len(triples), _AT_ONCE)]
    agrees = np.concatenate([_agreeing(every[some], first, second, tolerance_m) for some in parts])
    is_left = np.ones(len(first), dtype=bool)
    found: list[tuple[SE3, BoolArray]] = []
    while len(found) < max_count:
        # A transform of fewer pairs, such as of a repeated object, shows among the pairs that others leave.
        best = int(np.argmax(agrees @ is_left.astype(np.int64)))
        at, mine = _refine(every[best], agrees[best], first, second, tolerance_m)
        if mine.sum() < _FEWEST_PAIRS or not np.any(mine & is_left):
            break
        if not any(are_one(at, other, first, _SAME_M_RAD) for other, _ in found):
            found.append((at, mine))
        is_left &= ~mine
    return sorted(found, key=lambda each: -int(each[1].sum()))


def _agreeing(transforms: SE3, first: Array, second: Array, tolerance_m: Array) -> BoolArray:
    """Which pairs agree with each transform, (..., n)."""
    moved = first @ transforms.rotation.mT + transforms.translation[..., None, :]
    agrees: BoolArray = np.sum((moved - second) ** 2, -1) < tolerance_m**2
    return agrees


def _refine(
    transform: SE3, agrees: BoolArray, first: Array, second: Array, tolerance_m: Array
) -> tuple[SE3, BoolArray]:
    """The transform of the pairs that agree with it, and these; as it was, and too few, if so."""
    for _ in range(_REFINEMENTS):
        if agrees.sum() < _FEWEST_PAIRS:
            break
        transform = umeyama(first[agrees], second[None, agrees], 1 / tolerance_m[None, agrees] ** 2)[0]
        agrees = _agreeing(transform, first, second, tolerance_m)
    return transform, agrees


def are_one(first: SE3, second: SE3, points: Array, limit: float) -> bool:
    """Whether two transforms move the middle of the points to one place, and are one rotation, within `limit`."""
    middle = np.median(points, axis=0)
    apart = np.linalg.norm(first @ middle - second @ middle)
    return bool(apart < limit and np.linalg.norm((first.inverse() @ second).rotvec) < limit)


def project_points(points: Array, camera_from_first: SE3, lens: Camera) -> Array:
    """Pixels of points in each of v views, (v, p, 2); NaN where the lens or the image does not show them.

    Args:
        points: (p, 3) [m].
        camera_from_first: (v,) of the frame of the points.
        lens: The lens.
    """
    at = np.einsum("vab,pb->vpa", camera_from_first.rotation, points) + camera_from_first.translation[:, None]
    return np.asarray(np.where(lens.sees(at)[..., None], lens.project(at), np.nan))


def refine_transform(
    points: Array, sightings: Tracks, camera_from_second: SE3, second_from_first: SE3, lens: Camera
) -> SE3:
    """`second_from_first` at which image points are nearest to the points that they show.

    Args:
        points: (p, 3) in the first frame [m].
        sightings: Image points of them.
        camera_from_second: (v,) of the views.
        second_from_first: Where to start.
        lens: Of these views.
    """
    own = points[sightings.point]
    camera = camera_from_second[sightings.view]

    def residuals(step: Array) -> Array:
        """Residuals after a step, (n, 2) [px]."""
        moved = camera @ (second_from_first @ SE3.exp(step))
        place = (moved.rotation @ own[..., None])[..., 0] + moved.translation
        return np.asarray(np.nan_to_num(lens.project(place) - sightings.pixels, nan=1e3))

    for _ in range(_MOST_STEPS):
        step = robust_step(residuals, 6, _TAIL_PX)
        second_from_first = second_from_first @ SE3.exp(step)
        if np.abs(step).max() < STEP:
            break
    return second_from_first
