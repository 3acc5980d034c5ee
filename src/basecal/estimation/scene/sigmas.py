"""Estimate sigmas of image points and of robot stops by the marginal likelihood of a scene (REML).

The model is linearised about an optimum: the unknowns and the stop errors have a joint information matrix K for a sigma
of one pixel. Minus twice the log likelihood is (2 n - 3 p) ln s^2 + sum ln S + ln |K / s^2 + P| + cost, with the points
eliminated. Source: Harville 1977; docs/mathematics.md (5.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from basecal.effects.faces.shared_errors import TIE
from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, residuals_px
from basecal.estimation.scene.views import SceneViews
from basecal.geometry import Array

_PIXELS = (1e-3, 1e2)  # [px] bounds of the sigma of image points
_ROBOTS = (1e-7, 0.1)  # [m, rad] bounds of the sigmas of robots
_RELATIVE_DECREASE = 1e-6  # relative change of the likelihood at convergence
_IMPOSSIBLE = 1e12  # cost of sigmas for which the information is not positive definite


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

    def sigmas(self, logs: Array) -> tuple[float, Array]:
        """Sigmas from logarithms: image points, then translation and rotation of each robot without stated noise."""
        left = iter(np.exp(np.repeat(logs[1:].reshape(-1, 2), 3, axis=1)))
        by_robot = [next(left) if noise is None else noise for noise in self.stated]
        return float(np.exp(logs[0])), sigmas_by_stop(self.fit.views, by_robot)

    def negative_log_likelihood(self, logs: Array) -> float:
        """Minus twice the log likelihood, plus the prior cost of the sigmas."""
        sigma_px, stop_sigma = self.sigmas(logs)
        information = self.fit.pixel_information / sigma_px**2 + self.prior
        at = len(information) - stop_sigma.size + np.arange(stop_sigma.size)
        information[at, at] += (1 / stop_sigma**2).ravel()
        try:
            root = np.linalg.cholesky(information)
        except np.linalg.LinAlgError:
            return _IMPOSSIBLE
        gain = np.linalg.solve(root, self.gradient / sigma_px**2)
        freedoms = 2 * len(self.fit.tracks) - 3 * self.fit.tracks.count
        of_noise = 2 * freedoms * logs[0] + 2 * np.log(stop_sigma).sum() + 2 * np.log(np.diag(root)).sum()
        return float(of_noise + self.squares / sigma_px**2 - gain @ gain + self._prior_cost(logs))

    def _prior_cost(self, logs: Array) -> float:
        """Prior cost of the logarithms of robots' sigmas."""
        mean, factor = np.log(ROBOT_RAD)
        shift, turn = logs[1:].reshape(-1, 2).T
        reach_m = self.fit.views.reach_m[[noise is None for noise in self.stated]]
        tied = (shift - turn - np.log(np.maximum(reach_m, 0.1))) / np.log(TIE)
        return float(np.sum(((turn - mean) / factor) ** 2 + tied**2))


def sigmas_by_stop(views: SceneViews, by_robot: Sequence[Array]) -> Array:
    """Expand the sigmas of each robot to all stops, (s, 6)."""
    return np.array(by_robot)[views.stop_robot].reshape(-1, 6)


def estimate_sigmas(fit: SceneFit, stop_noise: Sequence[Array | None]) -> tuple[float, Array]:
    """Most likely sigmas about an optimum: of image points [px], and of stop errors, (s, 6) [m, rad].

    Args:
        fit: The optimum.
        stop_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.
    """
    own = fit.columns.errors
    prior = fit.information - fit.pixel_information / fit.sigma_px**2
    prior[own, own] = 0.0
    errors = np.zeros(own.stop)
    errors[own] = fit.state.errors.ravel()
    carried = fit.pixel_information @ errors
    residuals = residuals_px(fit.views, fit.tracks, fit.state)
    residuals = residuals[np.isfinite(residuals)]  # points behind a camera are rejected in the next round
    squares = float(np.sum(residuals**2) - 2 * fit.pixel_gradient @ errors + errors @ carried)
    likelihood = _Likelihood(fit, stop_noise, prior, fit.pixel_gradient - carried, squares)
    now = [fit.stop_sigma[fit.views.stop_robot == k][0, ::3] for k, noise in enumerate(stop_noise) if noise is None]
    start = np.log(np.concatenate([[fit.sigma_px], *now]))
    bounds, options = np.log([_PIXELS] + [_ROBOTS] * (len(start) - 1)), {"ftol": _RELATIVE_DECREASE}
    cost = likelihood.negative_log_likelihood
    return likelihood.sigmas(minimize(cost, start, method="L-BFGS-B", bounds=bounds, options=options).x)
