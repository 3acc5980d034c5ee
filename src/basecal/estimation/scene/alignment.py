"""Align the scene points of two arms by rigid transforms, from point pairs with outliers.

Because of repeated objects, many pairs may agree with a wrong transform. Therefore several distinct transforms are
returned. The caller chooses between them by image points, and refines them on image points that one arm has of the
other's scene points. `benchmarks.scene` evaluates the constants of this module.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.views import Tracks
from basecal.estimation.start.pair_views import umeyama
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.numerics.robust_step import STEP, robust_step

_TRIPLES = 4000  # samples of three pairs: an inlier sample is found with 10 % probability at 97 % outliers
_BATCH_TRIPLES = 500
_REFINEMENTS = 4  # rounds of refinement on the inliers
_FEWEST_PAIRS = 8  # fewest inliers, five more than the three that define a transform
_SAME_M_RAD = 0.05  # [m, rad] within which two transforms are one hypothesis
_SEED = 1  # any seed works
_TAIL_PX = 3.0  # [px] scale of the Cauchy loss of image points
_MOST_STEPS = 10


def alignments(first: Array, second: Array, tolerance_m: Array, max_count: int) -> list[tuple[SE3, BoolArray]]:
    """Find distinct transforms `second_from_first` by RANSAC, with their inlier masks (n,), most inliers first.

    Args:
        first: (n, 3) points of the first arm [m].
        second: (n, 3) corresponding points of the second arm [m].
        tolerance_m: (n,) largest distance of an inlier pair [m].
        max_count: Most transforms to return.
    """
    if len(first) < _FEWEST_PAIRS:
        return []
    triples = np.random.default_rng(_SEED).integers(len(first), size=(_TRIPLES, 3))
    triples = triples[(np.diff(np.sort(triples, axis=1)) > 0).all(1)]
    transforms = umeyama(first[triples], second[triples], np.ones(triples.shape))
    batches = [slice(start, start + _BATCH_TRIPLES) for start in range(0, len(triples), _BATCH_TRIPLES)]
    inliers = np.concatenate([_inlier_mask(transforms[batch], first, second, tolerance_m) for batch in batches])
    is_left = np.ones(len(first), dtype=bool)
    found: list[tuple[SE3, BoolArray]] = []
    while len(found) < max_count:
        # Transforms with fewer inliers, such as the right one beside repeated objects, are found among the other pairs.
        best = int(np.argmax(inliers @ is_left.astype(np.int64)))
        transform, own_inliers = _refine(transforms[best], inliers[best], first, second, tolerance_m)
        if own_inliers.sum() < _FEWEST_PAIRS or not np.any(own_inliers & is_left):
            break
        if not any(are_equal(transform, other, first, _SAME_M_RAD) for other, _ in found):
            found.append((transform, own_inliers))
        is_left &= ~own_inliers
    return sorted(found, key=lambda each: -int(each[1].sum()))


def _inlier_mask(transforms: SE3, first: Array, second: Array, tolerance_m: Array) -> BoolArray:
    """Inlier mask of the pairs for each transform, (..., n)."""
    moved = first @ transforms.rotation.mT + transforms.translation[..., None, :]
    inliers: BoolArray = np.sum((moved - second) ** 2, -1) < tolerance_m**2
    return inliers


def _refine(
    transform: SE3, inliers: BoolArray, first: Array, second: Array, tolerance_m: Array
) -> tuple[SE3, BoolArray]:
    """Fit the transform to its inliers repeatedly; return it and its inlier mask, unchanged if inliers are too few."""
    for _ in range(_REFINEMENTS):
        if inliers.sum() < _FEWEST_PAIRS:
            break
        transform = umeyama(first[inliers], second[None, inliers], 1 / tolerance_m[None, inliers] ** 2)[0]
        inliers = _inlier_mask(transform, first, second, tolerance_m)
    return transform, inliers


def are_equal(first: SE3, second: SE3, points: Array, limit: float) -> bool:
    """Whether two transforms are equal within `limit`: their rotation [rad], and the moved median point [m]."""
    median = np.median(points, axis=0)
    distance = np.linalg.norm(first @ median - second @ median)
    return bool(distance < limit and np.linalg.norm((first.inverse() @ second).rotvec) < limit)


def project_points(points: Array, camera_from_first: SE3, lens: Camera) -> Array:
    """Project points to v views, (v, p, 2) [px]; NaN outside the lens's domain or the image.

    Args:
        points: (p, 3) [m].
        camera_from_first: (v,) poses of the points' frame in the camera.
        lens: The lens.
    """
    points_in_camera = (
        np.einsum("vab,pb->vpa", camera_from_first.rotation, points) + camera_from_first.translation[:, None]
    )
    return np.asarray(np.where(lens.sees(points_in_camera)[..., None], lens.project(points_in_camera), np.nan))


def refine_transform(
    points: Array, sightings: Tracks, camera_from_second: SE3, second_from_first: SE3, lens: Camera
) -> SE3:
    """Refine `second_from_first` by minimising reprojection errors, with Cauchy weights.

    Args:
        points: (p, 3) in the first frame [m].
        sightings: Image points of `points`.
        camera_from_second: (v,) poses of the second frame in the camera of each view.
        second_from_first: Initial transform.
        lens: Lens of the views.
    """
    points_in_first = points[sightings.point]
    camera_poses = camera_from_second[sightings.view]

    def residuals(step: Array) -> Array:
        """Residuals after a step, (n, 2) [px]."""
        moved = camera_poses @ (second_from_first @ SE3.exp(step))
        place = (moved.rotation @ points_in_first[..., None])[..., 0] + moved.translation
        return np.asarray(np.nan_to_num(lens.project(place) - sightings.pixels, nan=1e3))

    for _ in range(_MOST_STEPS):
        step = robust_step(residuals, 6, _TAIL_PX)
        second_from_first = second_from_first @ SE3.exp(step)
        if np.abs(step).max() < STEP:
            break
    return second_from_first
