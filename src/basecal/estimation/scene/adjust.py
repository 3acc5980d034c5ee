"""The most likely state of a scene: Levenberg-Marquardt with the points eliminated, and gross errors left out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.scene.equations import PixelEquations, pixel_equations, point_steps, reduced_equations
from basecal.estimation.scene.priors import prior_information
from basecal.estimation.scene.state import Columns, SceneState, column_jacobian, scene_columns, take_step
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, Camera

_MOST_STEPS = 30  # of one descent
_RELATIVE_DECREASE = 1e-6  # relative decrease of the cost that ends a descent
_FIRST_DAMPING = 1e-6  # of the diagonal
_LARGEST_DAMPING = 1e6
_POINT_STEPS = 2  # Gauss-Newton steps of the points after each step of the cameras


@dataclass(frozen=True, eq=False)
class SceneFit:
    """An optimum.

    Attributes:
        views: The views.
        tracks: The image points that were used.
        state: The optimum.
        sigma_px: Of image points [px].
        stop_sigma: (s, 6) of the errors of stops [m, rad].
        information: (m, m) about all columns.
        pixel_information: (m, m) the part of it that pixels give, at a sigma of one pixel.
        pixel_gradient: (m,) likewise.
        cost: Sum of squared residuals over sigmas.
        guesses: Lenses about which free ones are expected.
    """

    views: SceneViews
    tracks: Tracks
    state: SceneState
    sigma_px: float
    stop_sigma: Array
    information: Array
    pixel_information: Array
    pixel_gradient: Array
    cost: float
    guesses: tuple[Camera, ...]


@dataclass(frozen=True, eq=False)
class Task:
    """What a descent is given: views, image points, sigmas, and the guesses of free lenses.

    Attributes:
        views: The views.
        tracks: The image points.
        sigma_px: Of image points [px].
        stop_sigma: (s, 6) of the errors of stops [m, rad].
        guesses: Lenses about which free ones are expected.
        tail: Residual in sigmas from which on an image point counts less (Cauchy); infinite if none does.
    """

    views: SceneViews
    tracks: Tracks
    sigma_px: float
    stop_sigma: Array
    guesses: tuple[Camera, ...]
    tail: float = np.inf


def adjust(task: Task, state: SceneState) -> SceneFit:
    """The optimum downhill of a state."""
    columns = scene_columns(task.views, state.lenses)
    damping = _FIRST_DAMPING
    equations = _weight_equations(task, state)
    cost = _cost(task, state, equations)
    for _ in range(_MOST_STEPS):
        information, gradient = _normal(task, state, equations)
        after, decrease = None, 0.0
        while damping < _LARGEST_DAMPING:
            damped = information + damping * np.diag(np.diag(information) + 1e-12)
            tried = _take_step(task, state, columns, np.asarray(-np.linalg.solve(damped, gradient), dtype=np.float64))
            of_tried = equations if tried is None else _weight_equations(task, tried)
            decrease = -1.0 if tried is None else cost - _cost(task, tried, of_tried)
            if decrease >= 0:
                after, damping = tried, damping / 10
                break
            damping *= 10
        if after is None:
            break
        state, equations, cost = after, of_tried, cost - decrease
        if decrease < _RELATIVE_DECREASE * cost:
            break
    return _fit(task, state)


def _fit(task: Task, state: SceneState) -> SceneFit:
    """The optimum with its information."""
    views, tracks = task.views, task.tracks
    columns = scene_columns(views, state.lenses)
    equations = _weight_equations(task, state)
    reduced = reduced_equations(views, tracks, equations, columns)
    moves = column_jacobian(views, state, columns, len(reduced.gradient) - 6 * len(views))
    of_pixels = moves.T @ reduced.information @ moves * task.sigma_px**2
    prior = prior_information(views, state, columns, task.stop_sigma, task.guesses)
    return SceneFit(
        views,
        tracks,
        state,
        task.sigma_px,
        task.stop_sigma,
        of_pixels / task.sigma_px**2 + prior.information,
        of_pixels,
        moves.T @ reduced.gradient * task.sigma_px**2,
        _cost(task, state, equations),
        task.guesses,
    )


def residuals_px(views: SceneViews, tracks: Tracks, state: SceneState) -> Array:
    """Residuals of image points, (n, 2) [px]; infinite behind a camera."""
    equations = pixel_equations(views, tracks, state, np.ones(len(tracks)))
    return np.where(equations.seen[:, None], equations.residual, np.inf)


def _weight_equations(task: Task, state: SceneState) -> PixelEquations:
    """The equations, large residuals with less weight."""
    equations = pixel_equations(task.views, task.tracks, state, np.full(len(task.tracks), 1 / task.sigma_px))
    if not np.isfinite(task.tail):
        return equations
    share = 1 / np.sqrt(1 + np.sum(equations.residual**2, 1) / task.tail**2)
    scaled = {
        name: getattr(equations, name) * share.reshape(-1, *[1] * (getattr(equations, name).ndim - 1))
        for name in ("residual", "by_camera", "by_lens", "by_point")
    }
    return replace(equations, **scaled)


def _cost(task: Task, state: SceneState, equations: PixelEquations) -> float:
    """Of image points and priors; a point behind its camera costs as much as one at ten tails."""
    squares = np.sum(equations.residual**2, 1)
    if np.isfinite(task.tail):
        # Weighted squares w e^2 with w = 1 / (1 + e^2 / c^2) hold e^2 = s / (1 - s / c^2).
        share = np.minimum(squares / task.tail**2, 1 - 1e-12)
        squares = -(task.tail**2) * np.log1p(-share)
    worst = np.log1p(100.0) * min(task.tail, 10.0) ** 2
    columns = scene_columns(task.views, state.lenses)
    prior = prior_information(task.views, state, columns, task.stop_sigma, task.guesses)
    return float(squares.sum() + worst * np.count_nonzero(~equations.seen) + prior.cost)


def _normal(task: Task, state: SceneState, equations: PixelEquations) -> tuple[Array, Array]:
    """Information (m, m) and gradient (m,) of all columns."""
    views = task.views
    columns = scene_columns(views, state.lenses)
    reduced = reduced_equations(views, task.tracks, equations, columns)
    moves = column_jacobian(views, state, columns, len(reduced.gradient) - 6 * len(views))
    prior = prior_information(views, state, columns, task.stop_sigma, task.guesses)
    information = moves.T @ reduced.information @ moves + prior.information
    return information, moves.T @ reduced.gradient + prior.gradient


def _take_step(task: Task, state: SceneState, columns: Columns, step: Array) -> SceneState | None:
    """The state after a step, points at their best for it; None if it is so long that these have none."""
    try:
        return _with_points(task, take_step(state, columns, step))
    except np.linalg.LinAlgError:
        return None


def _with_points(task: Task, state: SceneState) -> SceneState:
    """The state with points at their best for its cameras."""
    for _ in range(_POINT_STEPS):
        equations = _weight_equations(task, state)
        state = replace(state, points=state.points + point_steps(task.tracks, equations))
    return state
