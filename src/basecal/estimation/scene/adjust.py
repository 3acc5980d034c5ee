"""Bundle adjustment of a scene with priors: Levenberg-Marquardt with the points eliminated.

`benchmarks.scene` evaluates the constants of this module.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from basecal.cell import Intrinsics
from basecal.estimation.least_squares.normal_equations import prior_residual
from basecal.estimation.scene.equations import PixelEquations, pixel_equations, point_steps, reduced_equations
from basecal.estimation.scene.state import Columns, SceneState, column_jacobian, scene_columns, take_step
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import Array, Camera, IntArray
from basecal.numerics.batch import stack, take
from basecal.numerics.levenberg_marquardt import Criteria, Quadratic, levenberg_marquardt

_MOST_STEPS = 30  # most steps of one descent
_SHARE_LEFT = 1e-3  # its square is the relative decrease of the cost that may remain at convergence
_POINT_STEPS = 2  # Gauss-Newton steps of the points after each step of the cameras
FOCAL_SHARE = 0.1  # [1] sigma of a free focal length about its guess; assumed
_CENTER_SHARE = 0.03  # [1] of the image size, sigma of a free principal point; assumed
_ASPECT_SHARE = 1e-3  # [1] sigma of fy / fx: pixels of today's sensors are square; assumed
_TERM_SIGMA = 1.0  # [1] sigma of a distortion term without a prior; assumed


@dataclass(frozen=True, eq=False)
class SceneProblem:
    """Input of a bundle adjustment: views, image points, sigmas, and guesses of free lenses.

    Attributes:
        views: The views.
        tracks: The image points.
        sigma_px: Sigma of image points [px].
        stop_sigma: (s, 6) sigmas of the pose errors of stops [m, rad].
        guesses: Guesses of the lenses, the prior means of free lenses.
        tail: Scale of the Cauchy loss in sigmas; infinite for least squares.
    """

    views: SceneViews
    tracks: Tracks
    sigma_px: float
    stop_sigma: Array
    guesses: tuple[Camera, ...]
    tail: float = field(default=np.inf, kw_only=True)

    @property
    def columns(self) -> Columns:
        """Columns of all unknowns that are not fixed."""
        return scene_columns(self.views, self.guesses)

    def linearise(self, state: SceneState) -> tuple[Quadratic, Quadratic]:
        """Linearise the image points and the priors about a state, in all columns."""
        return _reduce_equations(self, state), prior_information(self, state)


@dataclass(frozen=True, eq=False)
class SceneFit(SceneProblem):
    """Optimum of a problem.

    Attributes:
        state: The optimum.
        information: (m, m) information matrix of all columns.
        gradient: (m,) remaining gradient, since a descent ends near an optimum.
        pixel_information: (m, m) information of the pixels alone, for a sigma of one pixel.
        pixel_gradient: (m,) gradient of the pixels alone, for a sigma of one pixel.
    """

    state: SceneState
    information: Array
    gradient: Array
    pixel_information: Array
    pixel_gradient: Array


def adjust(problem: SceneProblem, state: SceneState) -> SceneFit:
    """Optimise a problem from an initial state."""
    optima = levenberg_marquardt(_System(problem), stack([state]), Criteria(_MOST_STEPS, tolerance=_SHARE_LEFT))
    return scene_fit(problem, take(optima.state, 0))


def scene_fit(problem: SceneProblem, state: SceneState) -> SceneFit:
    """Make the `SceneFit` of a problem from its final state."""
    pixels, prior = problem.linearise(state)
    variance, information = problem.sigma_px**2, pixels.hessian + prior.hessian
    return SceneFit(
        **vars(problem),
        state=state,
        information=information,
        gradient=pixels.gradient + prior.gradient,
        pixel_information=pixels.hessian * variance,
        pixel_gradient=pixels.gradient * variance,
    )


@dataclass(frozen=True)
class _System:
    """A scene as a `System` for Levenberg-Marquardt, a batch of one; see `numerics.levenberg_marquardt`."""

    problem: SceneProblem

    def linearise(self, state: SceneState) -> Quadratic:
        """See `System`."""
        pixels, prior = self.problem.linearise(take(state, 0))
        return Quadratic(*(left[None] + right for left, right in zip(pixels[:3], prior[:3], strict=True)))

    def retract(self, state: SceneState, model: Quadratic, step: Array) -> SceneState:
        """See `System`; the points are optimised for the cameras after the step."""
        single = take(state, 0)
        after = take_step(single, self.problem.columns, step[0])
        for _ in range(_POINT_STEPS):
            after = after.with_points(
                after.points + point_steps(self.problem.tracks, _weigh_equations(self.problem, after))
            )
        return stack([after])

    def take(self, rows: IntArray) -> _System:
        """See `System`."""
        return self


def _reduce_equations(problem: SceneProblem, state: SceneState) -> Quadratic:
    """Normal equations of image points in all columns.

    A point behind its camera costs as much as a residual of ten times `tail`, with `tail` at most 10.
    """
    equations, columns = _weigh_equations(problem, state), problem.columns
    gradient, information = reduced_equations(problem.views.camera, problem.tracks, equations, columns.lens_widths)
    moves = column_jacobian(problem.views, state, columns)
    squares = np.sum(equations.residual**2, 1)
    if np.isfinite(problem.tail):
        # Weighted squares w e^2 with w = 1 / (1 + e^2 / c^2) hold e^2 = s / (1 - s / c^2).
        share = np.minimum(squares / problem.tail**2, 1 - 1e-12)
        squares = -(problem.tail**2) * np.log1p(-share)
    worst = np.log1p(100.0) * min(problem.tail, 10.0) ** 2
    cost = np.array(squares.sum() + worst * np.count_nonzero(~equations.seen))
    return Quadratic(cost, moves.T @ gradient, moves.T @ information @ moves)


def residuals_px(views: SceneViews, tracks: Tracks, state: SceneState) -> Array:
    """Residuals of image points, (n, 2) [px]; infinite for points behind the camera."""
    equations = pixel_equations(views, tracks, state, 1.0)
    return np.where(equations.seen[:, None], equations.residual, np.inf)


def _weigh_equations(problem: SceneProblem, state: SceneState) -> PixelEquations:
    """Equations of the image points, with Cauchy weights."""
    equations = pixel_equations(problem.views, problem.tracks, state, 1 / problem.sigma_px)
    share = 1 / np.sqrt(1 + np.sum(equations.residual**2, 1, keepdims=True) / problem.tail**2)
    return equations.scale(share)


def prior_information(problem: SceneProblem, state: SceneState) -> Quadratic:
    """Prior cost, gradient and information of mounts, bases, lenses and stop errors."""
    columns, sigmas = problem.columns, problem.stop_sigma
    width = columns.errors.stop
    gradient, information, cost = np.zeros(width), np.zeros((width, width)), 0.0
    for residual, jacobian, part in _residuals(problem, state):
        gradient[part] += jacobian.T @ residual
        information[part, part] += jacobian.T @ jacobian
        cost += float(residual @ residual)
    error_gradient = (state.errors / sigmas**2).ravel()
    gradient[columns.errors] = error_gradient
    diagonal = np.arange(columns.errors.start, columns.errors.stop)
    information[diagonal, diagonal] = (1 / sigmas**2).ravel()
    return Quadratic(np.array(cost + error_gradient @ state.errors.ravel()), gradient, information)


def _residuals(problem: SceneProblem, state: SceneState) -> list[tuple[Array, Array, slice]]:
    """Prior residuals in sigmas with their Jacobians and columns, without those of stop errors."""
    found, views, columns = [], problem.views, problem.columns
    mounts = tuple(camera.mount for camera in views.cameras)
    stacks = (mounts, state.mounts, columns.mounts), (views.bases, state.bases, columns.bases)
    unknowns = [
        (stated, values[k], part[k]) for all_stated, values, part in stacks for k, stated in enumerate(all_stated)
    ]
    for stated, value, part in unknowns:
        if part is not None and stated.status == "prior":
            found.append((*prior_residual(stated, value), part))
    for camera, lens, guess, part in zip(views.cameras, state.lenses, problem.guesses, columns.lenses, strict=True):
        if part is not None:
            found.append((*_lens_residual(camera.lens, lens, guess), part))
    return found


def _lens_residual(intrinsics: Intrinsics, value: Camera, guess: Camera) -> tuple[Array, Array]:
    """Prior residual of a lens and its Jacobian: from stated sigmas, or from typical lenses if the lens is free."""
    if intrinsics.status == "prior" and intrinsics.camera is not None and intrinsics.sigma is not None:
        return (value.parameters - intrinsics.camera.parameters) / intrinsics.sigma, np.diag(1 / intrinsics.sigma)
    count = len(value.parameters)
    focal = float(guess.focal.mean())
    width, height = guess.size_px or (2 * focal, 2 * focal)
    terms = np.where(np.isfinite(guess.term_sigmas), guess.term_sigmas, _TERM_SIGMA)
    rows = np.eye(count)
    rows[0] *= 1 / (FOCAL_SHARE * focal)
    rows[1] = (rows[1] - np.eye(count)[0]) / (_ASPECT_SHARE * focal)
    rows[2:4] /= _CENTER_SHARE * np.array([[width], [height]])
    rows[4:] /= terms[:, None]
    expected = np.concatenate([[focal, focal], guess.center, np.zeros(count - 4)])
    return rows @ (value.parameters - expected), rows
