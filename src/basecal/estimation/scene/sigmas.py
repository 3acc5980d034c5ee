"""Estimate sigmas of image points and of robot stops by the marginal likelihood of a scene (REML).

The model is linearised about an optimum: the unknowns and the stop errors have a joint information matrix K for a sigma
of one pixel. Minus twice the log likelihood is (2 n - 3 p) ln s^2 + sum ln S + ln |K / s^2 + P| + cost, with the points
eliminated. Source: Harville 1977; docs/mathematics.md (5.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from basecal.effects.faces.shared_errors import TIE
from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, residuals_px
from basecal.estimation.scene.views import SceneViews
from basecal.geometry import Array

_PIXEL_BOUNDS_PX = (1e-3, 1e2)  # [px] bounds of the sigma of image points
_ROBOT_BOUNDS = (1e-7, 0.1)  # [m, rad] bounds of the sigmas of robots
_RELATIVE_DECREASE = 1e-6  # relative change of the likelihood at convergence
_INDEFINITE_COST = 1e12  # cost of sigmas for which the information is not positive definite


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """Marginal likelihood of a scene about an optimum.

    Attributes:
        fit: The optimum.
        stated: (6,) noise of each robot [m, rad]; None if it is to be estimated.
        prior: (m, m) prior information, without that of stop errors.
        gradient: (m,) gradient of the pixels for a sigma of one pixel, about stop errors of zero.
        squares: Sum of squared residuals about stop errors of zero [px^2].
    """

    fit: SceneFit
    stated: Sequence[Array | None]
    prior: Array
    gradient: Array
    squares: float

    @classmethod
    def expand(cls, fit: SceneFit, stop_noise: Sequence[Array | None]) -> _Likelihood:
        """Expand about an optimum."""
        error_columns = fit.columns.errors
        prior = fit.information - fit.pixel_information / fit.sigma_px**2
        prior[error_columns, error_columns] = 0.0
        errors = np.zeros(error_columns.stop)
        errors[error_columns] = fit.state.errors.ravel()
        error_force = fit.pixel_information @ errors
        residuals = residuals_px(fit.views, fit.tracks, fit.state)
        residuals = residuals[np.isfinite(residuals)]  # points behind a camera are rejected in the next round
        squares = float(np.sum(residuals**2) - 2 * fit.pixel_gradient @ errors + errors @ error_force)
        return cls(fit, stop_noise, prior, fit.pixel_gradient - error_force, squares)

    def sigmas(self, logs: Array) -> tuple[float, Array]:
        """Sigmas from logarithms: image points, then translation and rotation of each robot without stated noise."""
        estimated = iter(np.exp(np.repeat(logs[1:].reshape(-1, 2), 3, axis=1)))
        by_robot = [next(estimated) if noise is None else noise for noise in self.stated]
        return float(np.exp(logs[0])), sigmas_by_stop(self.fit.views, by_robot)

    def negative_log_likelihood(self, logs: Array) -> tuple[float, Array]:
        """Minus twice the log likelihood, plus the prior cost of the sigmas, and its gradient in the logarithms."""
        sigma_px, stop_sigma = self.sigmas(logs)
        pixels, stop_information = self.fit.pixel_information / sigma_px**2, 1 / stop_sigma.ravel() ** 2
        information = pixels + self.prior
        diagonal = np.einsum("ii->i", information)  # a view
        diagonal[-len(stop_information) :] += stop_information
        try:
            root = np.linalg.inv(np.linalg.cholesky(information))
        except np.linalg.LinAlgError:
            return _INDEFINITE_COST, np.zeros(len(logs))
        inverse, force = root.T @ root, self.gradient / sigma_px**2
        step = inverse @ force
        freedoms = 2 * len(self.fit.tracks) - 3 * self.fit.tracks.count
        log_dets = 2 * np.log(stop_sigma).sum() - 2 * np.log(np.diag(root)).sum()
        squares = self.squares / sigma_px**2
        by_pixels = freedoms - np.vdot(inverse, pixels) - squares + step @ (2 * force - pixels @ step)
        by_stops = 1 - stop_information * (np.diag(inverse) + step**2)[-len(stop_information) :]
        prior, slope = self._prior_cost(logs)
        value = 2 * freedoms * logs[0] + log_dets + squares - force @ step + prior
        return float(value), 2 * np.append(by_pixels, self._sum_by_sigma(by_stops)) + slope

    def _sum_by_sigma(self, by_stops: Array) -> Array:
        """Sum values of all stops' errors, (6 s,), for translation and rotation of each robot without stated noise."""
        by_stop = by_stops.reshape(-1, 2, 3).sum(-1)
        robot = self.fit.views.stop_robot
        return np.array([by_stop[robot == k].sum(0) for k, noise in enumerate(self.stated) if noise is None]).ravel()

    def _prior_cost(self, logs: Array) -> tuple[float, Array]:
        """Prior cost of the logarithms of robots' sigmas, and its gradient."""
        mean, factor = np.log(ROBOT_RAD)
        translation, rotation = logs[1:].reshape(-1, 2).T
        reach_m = self.fit.views.reach_m[[noise is None for noise in self.stated]]
        lever_residual = (translation - rotation - np.log(np.maximum(reach_m, 0.1))) / np.log(TIE)
        rotation_residual = (rotation - mean) / factor
        slope = 2 * np.column_stack(
            [lever_residual / np.log(TIE), rotation_residual / factor - lever_residual / np.log(TIE)]
        )
        return float(np.sum(rotation_residual**2 + lever_residual**2)), np.append(0.0, slope)


def sigmas_by_stop(views: SceneViews, by_robot: Sequence[Array]) -> Array:
    """Expand the sigmas of each robot to all stops, (s, 6)."""
    return np.array(by_robot)[views.stop_robot].reshape(-1, 6)


def estimate_sigmas(
    fit: SceneFit, stop_noise: Sequence[Array | None], holds_pixels: bool = False
) -> tuple[float, Array]:
    """Most likely sigmas about an optimum: of image points [px], and of stop errors, (s, 6) [m, rad].

    Args:
        fit: The optimum.
        stop_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.
        holds_pixels: Whether to keep the sigma of image points: squares of gross ones are no noise.
    """
    likelihood = _Likelihood.expand(fit, stop_noise)
    if holds_pixels:  # a large constant would end the search early
        likelihood = replace(likelihood, squares=0.0)
    stop_sigmas = [
        fit.stop_sigma[fit.views.stop_robot == k][0, ::3] for k, noise in enumerate(stop_noise) if noise is None
    ]
    start = np.log(np.concatenate([[fit.sigma_px], *stop_sigmas]))
    pixel_bounds = (fit.sigma_px, fit.sigma_px) if holds_pixels else _PIXEL_BOUNDS_PX
    bounds, options = np.log([pixel_bounds] + [_ROBOT_BOUNDS] * (len(start) - 1)), {"ftol": _RELATIVE_DECREASE}
    cost = likelihood.negative_log_likelihood
    return likelihood.sigmas(minimize(cost, start, method="L-BFGS-B", jac=True, bounds=bounds, options=options).x)
