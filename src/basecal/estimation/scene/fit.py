"""Fit a scene from an initial state: triangulation, rejection of outliers in rounds, estimation of sigmas.

`benchmarks.scene` evaluates the constants of this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, Task, adjust, residuals_px
from basecal.estimation.scene.equations import pixel_equations, point_information, sums
from basecal.estimation.scene.sigmas import estimate_sigmas, sigmas_by_stop
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, BoolArray, Camera
from basecal.numerics.robust_step import NORMAL_MAD

_REFINEMENTS = 4  # rounds of outlier rejection
_FIRST_PX = 2.0  # [px] initial sigma of image points
_TAIL = 2.0  # scale of the Cauchy loss in sigmas
_GROSS = 4.0  # sigmas beyond which an image point is an outlier
_FIRST_LIMIT_PX = 12.0  # [px] outlier limit of the first round, halved in each round
_DEPTH_SHARE = 0.2  # of the distance: points with a larger sigma are rejected
_LEAST_ANGLE_DEG = 0.3  # rms angle of a point's rays to their mean, below which its depth is noise


def fit_scene(
    views: SceneViews,
    tracks: Tracks,
    start: SceneState,
    guesses: tuple[Camera, ...],
    stop_noise: Sequence[Array | None],
) -> SceneFit:
    """Fit a scene by maximum likelihood, from initial mounts, bases and lenses.

    Args:
        views: The views.
        tracks: The image points.
        start: Initial state; its points are ignored and triangulated.
        guesses: Guesses of the lenses, the prior means of free lenses.
        stop_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.

    Raises:
        np.linalg.LinAlgError: if too few points are left.
    """
    usual = [np.repeat([ROBOT_RAD[0] * reach_m, ROBOT_RAD[0]], 3) for reach_m in views.reach_m]
    by_robot = [own if noise is None else noise for own, noise in zip(usual, stop_noise, strict=True)]
    points, is_seen = triangulate(views, tracks, start)
    tracks, kept = tracks.take(is_seen[tracks.point])
    state = replace(start, points=points[kept])
    task = Task(views, tracks, _FIRST_PX, sigmas_by_stop(views, by_robot), guesses, tail=_TAIL)
    for number in range(_REFINEMENTS):
        _check_points(task)
        found = adjust(task, state)
        sigma_px = _robust_sigma(found)
        _, stop_sigma = estimate_sigmas(replace(found, sigma_px=sigma_px), stop_noise, holds_pixels=True)
        limit_px = max(_GROSS * sigma_px, _FIRST_LIMIT_PX / 2**number if number < _REFINEMENTS - 1 else 0.0)
        tracks, state = _without_gross(found, limit_px)
        task = replace(task, tracks=tracks, sigma_px=sigma_px, stop_sigma=stop_sigma)
    task = replace(task, tail=np.inf)
    _check_points(task)
    for _ in range(2):
        found = adjust(task, state)
        sigma_px, stop_sigma = estimate_sigmas(found, stop_noise)
        task, state = replace(task, sigma_px=sigma_px, stop_sigma=stop_sigma), found.state
    return adjust(task, state)


def _check_points(task: Task) -> None:
    if 2 * len(task.tracks) - 3 * task.tracks.count <= task.columns.errors.start:
        raise np.linalg.LinAlgError("too few points of the scene are left")


def _robust_sigma(fit: SceneFit) -> float:
    """Robust sigma of image points [px]: from the median residual, corrected for the number of unknowns."""
    residual = residuals_px(fit.views, fit.tracks, fit.state)
    equations = residual.size
    unknowns = 3 * fit.tracks.count + 6 * len(fit.views)
    share = max(1 - unknowns / max(equations, 1), 0.1)
    finite = residual[np.isfinite(residual)]
    return float(NORMAL_MAD * np.median(np.abs(finite)) / np.sqrt(share))


def _without_gross(fit: SceneFit, limit_px: float) -> tuple[Tracks, SceneState]:
    """Reject image points beyond a limit and points of uncertain depth; return tracks and state without them."""
    views, tracks, state = fit.views, fit.tracks, fit.state
    off = np.linalg.norm(residuals_px(views, tracks, state), axis=1)
    equations = pixel_equations(views, tracks, state, 1 / fit.sigma_px)
    worst = np.sqrt(np.trace(np.linalg.inv(point_information(tracks, equations)), axis1=1, axis2=2))
    centres = state.world_from_camera(views).translation[tracks.view]
    distance = np.linalg.norm(state.points[tracks.point] - centres, axis=1)
    deep = worst[tracks.point] < _DEPTH_SHARE * distance
    kept, old = tracks.take((off < limit_px) & deep)
    return kept, replace(state, points=state.points[old])


def triangulate(views: SceneViews, tracks: Tracks, state: SceneState) -> tuple[Array, BoolArray]:
    """Triangulate points, (p, 3) [m], and check that they are in front of all their cameras with sufficient parallax.

    Each point minimises the sum of squared distances to its rays.
    """
    world_from_camera = state.world_from_camera(views)
    direction, valid = views.directions(tracks, state.lenses)
    ray = (world_from_camera.rotation[tracks.view] @ direction[..., None])[..., 0]
    centre = world_from_camera.translation[tracks.view]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    count = tracks.count
    whole: Array = sums(tracks.point, count, across) + 1e-12 * np.eye(3)
    points = np.linalg.solve(whole, sums(tracks.point, count, across @ centre[..., None]))[..., 0]
    mean = sums(tracks.point, count, ray)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    sine = np.linalg.norm(np.cross(ray, mean[tracks.point]), axis=1)
    rms = np.sqrt(sums(tracks.point, count, sine[:, None] ** 2)[:, 0] / np.maximum(np.bincount(tracks.point), 1))
    behind = np.vecdot(ray, points[tracks.point] - centre) <= 0
    is_lost = np.bincount(tracks.point, behind | ~valid, minlength=count) > 0
    return np.asarray(points, dtype=np.float64), (rms > np.radians(_LEAST_ANGLE_DEG)) & ~is_lost
