"""Find a camera's mount without a guess, from pairs of image points and recorded poses alone.

With d the directions of a pair rotated into the base, (d_i x d_j) . [(t_j - t_i) + (R_j - R_i) p] = 0 for poses (R, t)
of the flange. For a given camera rotation, this is linear in the position p of the camera on the flange, in metres.
Rotations are searched on a grid, and the best are refined by Sampson distances. No scene points are estimated, and
planar scenes are not degenerate. Wrong recorded poses cause residuals of many pixels. `benchmarks.scene` evaluates the
constants of this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.estimation.scene.adjust import FOCAL_SHARE
from basecal.estimation.scene.views import Tracks
from basecal.geometry import SE3, Array, BoolArray, Camera
from basecal.geometry.rotation import cross_matrix, rotation_from_quaternion
from basecal.numerics.batch import space_evenly, take
from basecal.numerics.robust_step import STEP, robust_step

_ROTATIONS = 1000  # rotations of the grid, 25 degrees apart: basins of attraction are 20 to 30 degrees wide
_REFINED = 8  # best rotations of the grid that are refined
_RANKED = 500  # pairs used to rank the grid
_BATCH_ROTATIONS = 100  # rotations of the grid that are tried as one batch
_REFINEMENTS = 5  # rounds of reweighting, each of which halves the effect of outliers or more
_TAILS_PX = (10.0, 3.0, 2.0)  # [px] scales of the Cauchy loss, in sequence
_MOST_STEPS = 8  # most steps for each scale
_SHORTEST_M = 1e-2  # [m] shortest baseline in a divisor
_SPIRAL = 2.0**0.5, 1.533751168755204288118041  # Alexa 2022, super-Fibonacci spirals
_MIXING = 7919, 10007  # a prime times a view's index modulo another separates neighbours in time: any primes work


@dataclass(frozen=True, eq=False)
class MountStart:
    """A mount, and its residuals of point pairs.

    Attributes:
        flange_from_camera: The mount.
        lens: Lens with the best focal length.
        median_px: Median distance of pairs from their epipolar geometry [px].
        front: Share of the pairs whose rays meet in front of both cameras.
    """

    flange_from_camera: SE3
    lens: Camera
    median_px: float
    front: float = 1.0

    @property
    def is_behind(self) -> bool:
        """Whether most points would be behind the camera, which epipolar distances cannot detect."""
        return self.front < 1 / 2

    @property
    def misfit(self) -> tuple[bool, float]:
        """Sort key of starts, the best first: whether points are behind the camera, then the median distance [px]."""
        return self.is_behind, self.median_px


def find_mount(
    pairs: PointPairs, base_from_flange: SE3, lens: Camera, is_free: bool, guess: SE3 | None = None
) -> MountStart | None:
    """Find the mount that fits pairs of image points best; None if there are too few pairs.

    Args:
        pairs: Point pairs of one camera.
        base_from_flange: (v,) recorded poses of all views.
        lens: The lens, or its guess.
        is_free: Whether the focal length is refined.
        guess: Initial mount; all rotations are searched if it is None.
    """
    if len(pairs[0]) < _RANKED // 10:
        return None
    if guess is not None:
        return _refine(pairs, base_from_flange, guess, lens, is_free)
    ranked = take(pairs, space_evenly(len(pairs[0]), _RANKED))
    rotations = rotation_grid(_ROTATIONS)
    scored_batches = [
        _score_rotations(ranked, base_from_flange, lens, batch)
        for batch in np.split(rotations, _ROTATIONS // _BATCH_ROTATIONS)
    ]
    positions, scores = (np.concatenate([each[k] for each in scored_batches]) for k in (0, 1))
    best = np.argsort(scores)[:_REFINED]
    refined = [
        _refine(ranked, base_from_flange, SE3(rotations[k], positions[k]), lens, is_free, _TAILS_PX[:1]) for k in best
    ]
    first = min(refined, key=lambda start: start.misfit)
    return _refine(pairs, base_from_flange, first.flange_from_camera, first.lens, is_free, _TAILS_PX[1:])


def rotation_grid(count: int) -> Array:
    """Evenly distributed rotations, (count, 3, 3). Source: Alexa 2022."""
    s = np.arange(count) + 0.5
    inner, outer = np.sqrt(s / count), np.sqrt(1 - s / count)
    first, second = (2 * np.pi * s / each for each in _SPIRAL)
    parts = inner * np.sin(first), inner * np.cos(first), outer * np.sin(second), outer * np.cos(second)
    return rotation_from_quaternion(np.stack(parts, -1))


def _score_rotations(pairs: PointPairs, base_from_flange: SE3, lens: Camera, rotations: Array) -> tuple[Array, Array]:
    """Best position of the camera for each rotation, (r, 3) [m], and the median sine of the epipolar error, (r,)."""
    first, second = directions(pairs, lens)
    first_pose, second_pose = (base_from_flange[each.view] for each in pairs)
    ray = np.einsum("nab,rbc,nc->rna", first_pose.rotation, rotations, first, optimize=True)
    normal = np.cross(ray, np.einsum("nab,rbc,nc->rna", second_pose.rotation, rotations, second, optimize=True))
    rotation_change = second_pose.rotation - first_pose.rotation
    translation_change = second_pose.translation - first_pose.translation
    rows = np.einsum("rna,nab->rnb", normal, rotation_change)
    right = -np.einsum("rna,na->rn", normal, translation_change)
    weight = np.ones(right.shape)
    for _ in range(_REFINEMENTS):
        information = np.einsum("rn,rna,rnb->rab", weight, rows, rows, optimize=True) + 1e-9 * np.eye(3)
        position = np.linalg.solve(
            information, np.einsum("rn,rna,rn->ra", weight, rows, right, optimize=True)[..., None]
        )
        residual = np.abs((rows @ position)[..., 0] - right)
        baseline = np.linalg.norm(
            translation_change + np.einsum("nab,rb->rna", rotation_change, position[..., 0]), axis=-1
        )
        sine = residual / np.maximum(baseline, _SHORTEST_M)
        median = np.median(sine, axis=1, keepdims=True)
        weight = 1 / (1 + (sine / (1.5 * median + 1e-12)) ** 2) / np.maximum(baseline, _SHORTEST_M) ** 2
    return position[..., 0], median[:, 0]


def _refine(
    pairs: PointPairs,
    base_from_flange: SE3,
    start: SE3,
    lens: Camera,
    is_free: bool,
    tails_px: Sequence[float] = _TAILS_PX,
) -> MountStart:
    """Minimise Sampson distances from an initial mount."""
    mount, logarithm, rays = start, 0.0, directions(pairs, lens)

    def distances(step: Array) -> Array:
        """Distances after a step of the mount, and of the logarithm of a free focal length, (n, 1) [px]."""
        scaled = scale_focal(lens, np.exp(logarithm + step[6:].sum()))
        step_rays = directions(pairs, scaled) if step[6:].any() else rays
        moved_mount = mount @ SE3.exp(step[:6])
        return sampson_px(pairs, step_rays, base_from_flange, moved_mount, float(scaled.focal.mean()))[:, None]

    prior = np.diag([0.0] * 6 + [1 / FOCAL_SHARE**2] * is_free)
    for tail_px in tails_px:
        for _ in range(_MOST_STEPS):
            step = robust_step(distances, len(prior), tail_px, prior, prior[:, -1] * logarithm)
            mount = mount @ SE3.exp(step[:6])
            if is_free:
                logarithm += float(step[6])
                rays = directions(pairs, scale_focal(lens, np.exp(logarithm)))
            if np.abs(step).max() < STEP:
                break
    median_px = float(np.median(np.abs(distances(np.zeros(6)))))
    front = float(np.mean(are_in_front(pairs, rays, base_from_flange, mount)))
    return MountStart(mount, scale_focal(lens, np.exp(logarithm)), median_px, front)


def scale_focal(lens: Camera, factor: float) -> Camera:
    """Return the lens with its focal lengths multiplied by a factor."""
    scaled = lens.parameters.copy()
    scaled[:2] *= factor
    return lens.with_parameters(scaled)


PointPairs = tuple[Tracks, Tracks]
"""Image points of one camera, and image points of the same scene points in other views."""


def directions(pairs: PointPairs, lens: Camera) -> tuple[Array, Array]:
    """Unit directions of both image points of each pair, (n, 3) each; zero for pairs outside the lens's domain."""
    (first, is_first), (second, is_second) = (lens.undistort(each.pixels) for each in pairs)
    valid = (is_first & is_second)[:, None]
    return np.where(valid, first, 0.0), np.where(valid, second, 0.0)


def point_pairs(tracks: Tracks, max_count: int) -> PointPairs:
    """Select at most `max_count` pairs of image points of a camera, from views that are mostly not consecutive."""
    factor, modulus = _MIXING
    order = np.lexsort((tracks.view * factor % modulus, tracks.point))
    neighbours = np.flatnonzero(tracks.point[order[1:]] == tracks.point[order[:-1]])
    selected = neighbours[space_evenly(len(neighbours), max_count)]
    return take(tracks, order[selected]), take(tracks, order[selected + 1])


def sampson_px(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3, focal_px: float
) -> Array:
    """Sampson distance of each pair from the epipolar geometry, (n,) [px]. Source: Sampson 1982.

    Args:
        pairs: Point pairs of one camera.
        rays: Directions of both image points, (n, 3) each; see `directions`.
        base_from_flange: (v,) poses of all views.
        flange_from_camera: The mount.
        focal_px: Focal length [px].
    """
    first, second = (each / np.maximum(each[:, 2:], 1e-3) for each in rays)
    base_from_camera = base_from_flange @ flange_from_camera
    between = base_from_camera[pairs[0].view].inverse() @ base_from_camera[pairs[1].view]
    essential = cross_matrix(between.translation) @ between.rotation
    to_first, to_second = (essential @ second[..., None])[..., 0], (essential.mT @ first[..., None])[..., 0]
    slope = np.sum(to_first[:, :2] ** 2, 1) + np.sum(to_second[:, :2] ** 2, 1)
    return np.asarray(focal_px * np.sum(first * to_first, 1) / np.sqrt(slope + 1e-30))


def are_in_front(
    pairs: PointPairs, rays: tuple[Array, Array], base_from_flange: SE3, flange_from_camera: SE3
) -> BoolArray:
    """Whether the rays of each pair meet in front of both cameras, (n,); see `sampson_px`."""
    base_from_camera = base_from_flange @ flange_from_camera
    first_pose, second_pose = (base_from_camera[each.view] for each in pairs)
    first = (first_pose.rotation @ rays[0][..., None])[..., 0]
    second = (second_pose.rotation @ rays[1][..., None])[..., 0]
    normal, baseline = np.cross(first, second), second_pose.translation - first_pose.translation
    depths = [np.vecdot(np.cross(baseline, ray), normal) for ray in (second, first)]
    return np.asarray((depths[0] > 0) & (depths[1] > 0))
