"""A scene fitted from a start: points, gross errors left out round by round, and sigmas estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, Task, adjust, residuals_px
from basecal.estimation.scene.equations import pixel_equations, point_information
from basecal.estimation.scene.points import triangulate
from basecal.estimation.scene.sigmas import estimate_sigmas
from basecal.estimation.scene.state import SceneState, scene_columns
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, Camera

_REFINEMENTS = 4  # in which gross errors are left out
_FIRST_PX = 2.0  # [px] sigma of image points before any is known
_TAIL = 2.0  # sigmas from which on an image point counts less
_GROSS = 4.0  # sigmas beyond which an image point is left out
_FIRST_LIMIT_PX = 12.0  # [px] that are left out at first, halved in each round
_DEPTH_SHARE = 0.2  # of its distance: a point whose depth is known worse is left out
_NORMAL_MAD = 1.4826  # sigma over median absolute value, of a normal


def fit_scene(
    views: SceneViews,
    tracks: Tracks,
    start: SceneState,
    guesses: tuple[Camera, ...],
    stop_noise: Sequence[Array | None],
) -> SceneFit:
    """The most likely state of a scene downhill of mounts and bases.

    Args:
        views: The views.
        tracks: The image points.
        start: Where to start; its points are found anew.
        guesses: Lenses about which free ones are expected.
        stop_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.

    Raises:
        np.linalg.LinAlgError: if no points are left, or too few.
    """
    reach_m = _reach_m(views)
    stop_sigma = _first_sigmas(views, stop_noise, reach_m)
    state = start
    points, is_seen = triangulate(views, tracks, state)
    tracks, kept = tracks.take(is_seen[tracks.point])
    state = replace(state, points=points[kept])
    sigma_px = _FIRST_PX
    for number in range(_REFINEMENTS):
        _check_points(views, tracks, state)
        found = adjust(Task(views, tracks, sigma_px, stop_sigma, guesses, _TAIL), state)
        sigma_px = _robust_sigma(found)
        stop_sigma = estimate_sigmas(replace(found, sigma_px=sigma_px), stop_noise, reach_m).stop_sigma
        limit_px = max(_GROSS * sigma_px, _FIRST_LIMIT_PX / 2**number if number < _REFINEMENTS - 1 else 0.0)
        tracks, state = _without_gross(found, limit_px)
    _check_points(views, tracks, state)
    for _ in range(2):
        found = adjust(Task(views, tracks, sigma_px, stop_sigma, guesses), state)
        sigmas = estimate_sigmas(found, stop_noise, reach_m)
        sigma_px, stop_sigma, state = sigmas.sigma_px, sigmas.stop_sigma, found.state
    return adjust(Task(views, tracks, sigma_px, stop_sigma, guesses), state)


def _check_points(views: SceneViews, tracks: Tracks, state: SceneState) -> None:
    unknowns = scene_columns(views, state.lenses).errors.start
    if 2 * len(tracks) - 3 * tracks.count <= unknowns:
        raise np.linalg.LinAlgError("too few points of the scene are left")


def _reach_m(views: SceneViews) -> list[float]:
    """How far each robot's flange is from its base, root of the mean square [m]."""
    squares = np.sum(views.base_from_flange.translation**2, 1)
    return [float(np.sqrt(np.mean(squares[views.robot == k]))) for k in range(len(views.robots))]


def _first_sigmas(views: SceneViews, stop_noise: Sequence[Array | None], reach_m: Sequence[float]) -> Array:
    """Noise of stops that is stated, or usual, (s, 6)."""
    usual = [np.repeat([ROBOT_RAD[0] * reach, ROBOT_RAD[0]], 3) for reach in reach_m]
    by_robot = [own if noise is None else noise for own, noise in zip(usual, stop_noise, strict=True)]
    return np.array(by_robot)[views.stop_robot].reshape(-1, 6)


def _robust_sigma(fit: SceneFit) -> float:
    """Sigma of image points by the median of their residuals, which the unknowns have made smaller [px]."""
    residual = residuals_px(fit.views, fit.tracks, fit.state)
    equations = residual.size
    unknowns = 3 * fit.tracks.count + 6 * len(fit.views)
    share = max(1 - unknowns / max(equations, 1), 0.1)
    finite = residual[np.isfinite(residual)]
    return float(_NORMAL_MAD * np.median(np.abs(finite)) / np.sqrt(share))


def _without_gross(fit: SceneFit, limit_px: float) -> tuple[Tracks, SceneState]:
    """Image points within a limit, of points whose depth is known."""
    views, tracks, state = fit.views, fit.tracks, fit.state
    off = np.linalg.norm(residuals_px(views, tracks, state), axis=1)
    equations = pixel_equations(views, tracks, state, np.full(len(tracks), 1 / fit.sigma_px))
    worst = np.sqrt(np.trace(np.linalg.inv(point_information(tracks, equations)), axis1=1, axis2=2))
    centres = state.world_from_camera(views).translation[tracks.view]
    distance = np.linalg.norm(state.points[tracks.point] - centres, axis=1)
    deep = worst[tracks.point] < _DEPTH_SHARE * distance
    kept, old = tracks.take((off < limit_px) & deep)
    return kept, replace(state, points=state.points[old])
