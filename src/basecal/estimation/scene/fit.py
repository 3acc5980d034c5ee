"""Fit a scene from an initial state: triangulation, rejection of outliers in rounds, estimation of sigmas.

`benchmarks.scene` evaluates the constants of this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, SceneProblem, adjust, residuals_px
from basecal.estimation.scene.equations import pixel_equations, point_information
from basecal.estimation.scene.sigmas import estimate_sigmas, sigmas_by_stop
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, BoolArray, Camera
from basecal.numerics.group_sums import GroupSums
from basecal.numerics.robust_step import NORMAL_MAD

_REFINEMENTS = 4  # rounds of outlier rejection
_FIRST_SIGMA_PX = 2.0  # [px] initial sigma of image points
_TAIL_SIGMAS = 2.0  # scale of the Cauchy loss in sigmas
_GROSS_SIGMAS = 4.0  # sigmas beyond which an image point is an outlier
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
    default_noise = [np.repeat([ROBOT_RAD[0] * reach_m, ROBOT_RAD[0]], 3) for reach_m in views.reach_m]
    robot_noise = [
        default if noise is None else noise for default, noise in zip(default_noise, stop_noise, strict=True)
    ]
    points, is_seen = triangulate(views, tracks, start)
    tracks, kept = tracks.take(is_seen[tracks.point])
    state = replace(start, points=points[kept])
    problem = SceneProblem(
        views, tracks, _FIRST_SIGMA_PX, sigmas_by_stop(views, robot_noise), guesses, tail=_TAIL_SIGMAS
    )
    for number in range(_REFINEMENTS):
        _check_points(problem)
        fit = adjust(problem, state)
        sigma_px = _robust_sigma(fit)
        _, stop_sigma = estimate_sigmas(replace(fit, sigma_px=sigma_px), stop_noise, holds_pixels=True)
        limit_px = max(_GROSS_SIGMAS * sigma_px, _FIRST_LIMIT_PX / 2**number if number < _REFINEMENTS - 1 else 0.0)
        tracks, state = _without_gross(fit, limit_px)
        problem = replace(problem, tracks=tracks, sigma_px=sigma_px, stop_sigma=stop_sigma)
    problem = replace(problem, tail=np.inf)
    _check_points(problem)
    for _ in range(2):
        fit = adjust(problem, state)
        sigma_px, stop_sigma = estimate_sigmas(fit, stop_noise)
        problem, state = replace(problem, sigma_px=sigma_px, stop_sigma=stop_sigma), fit.state
    return adjust(problem, state)


def _check_points(problem: SceneProblem) -> None:
    if 2 * len(problem.tracks) - 3 * problem.tracks.count <= problem.columns.errors.start:
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
    distances = np.linalg.norm(residuals_px(views, tracks, state), axis=1)
    equations = pixel_equations(views, tracks, state, 1 / fit.sigma_px)
    point_sigma = np.sqrt(np.trace(np.linalg.inv(point_information(tracks, equations)), axis1=1, axis2=2))
    centres = state.world_from_camera(views).translation[tracks.view]
    distance = np.linalg.norm(state.points[tracks.point] - centres, axis=1)
    has_depth = point_sigma[tracks.point] < _DEPTH_SHARE * distance
    kept, kept_points = tracks.take((distances < limit_px) & has_depth)
    return kept, replace(state, points=state.points[kept_points])


def triangulate(views: SceneViews, tracks: Tracks, state: SceneState) -> tuple[Array, BoolArray]:
    """Triangulate points, (p, 3) [m], and check that they are in front of all their cameras with sufficient parallax.

    Each point minimises the sum of squared distances to its rays.
    """
    world_from_camera = state.world_from_camera(views)
    direction, valid = views.directions(tracks, state.lenses)
    ray = (world_from_camera.rotation[tracks.view] @ direction[..., None])[..., 0]
    centre = world_from_camera.translation[tracks.view]
    projection = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    sums = GroupSums(tracks.point, tracks.count)
    information = sums.sum(projection) + 1e-12 * np.eye(3)
    points = np.linalg.solve(information, sums.sum(projection @ centre[..., None]))[..., 0]
    mean = sums.sum(ray)
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    sines = np.linalg.norm(np.cross(ray, mean[tracks.point]), axis=1)
    rms_sine = np.sqrt(sums.sum(sines**2) / np.maximum(np.bincount(tracks.point), 1))
    behind = np.vecdot(ray, points[tracks.point] - centre) <= 0
    is_lost = np.bincount(tracks.point, behind | ~valid, minlength=tracks.count) > 0
    return np.asarray(points, dtype=np.float64), (rms_sine > np.radians(_LEAST_ANGLE_DEG)) & ~is_lost
