"""Sigmas of image points and of robots' stops by the marginal likelihood of a scene (REML).

About an optimum all is linear: the unknowns and the errors of stops share one information matrix K at a sigma of one
pixel. Minus twice the log likelihood is (2 n - 3 p) ln s^2 + sum ln S + ln |K / s^2 + P| + cost, the points eliminated.
Source: Harville 1977; docs/mathematics.md (5.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from basecal.effects.faces.shared_errors import TIE
from basecal.estimation.noise.hyperpriors import ROBOT_RAD
from basecal.estimation.scene.adjust import SceneFit, residuals_px
from basecal.estimation.scene.state import scene_columns
from basecal.geometry import Array

_PIXELS = (1e-3, 1e2)  # [px] within which a sigma is looked for
_ROBOTS = (1e-7, 0.1)  # [m, rad] likewise of robots
_RELATIVE_DECREASE = 1e-6  # relative change of the likelihood that ends the search
_IMPOSSIBLE = 1e12  # of sigmas that leave no positive definite information


@dataclass(frozen=True, eq=False)
class SceneSigmas:
    """Sigmas in use: of image points [px], and of the errors of stops, (s, 6) [m, rad]."""

    sigma_px: float
    stop_sigma: Array


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """The marginal likelihood of a scene about an optimum.

    Attributes:
        fit: The optimum.
        stated: (6,) noise of each robot [m, rad]; None if it is to be estimated.
        reach_m: Of each robot [m].
        prior: (m, m) information known beforehand, without that of errors of stops.
        gradient: (m,) of the pixels at a sigma of one, about errors of zero.
        squares: Of residuals there [px^2].
    """

    fit: SceneFit
    stated: Sequence[Array | None]
    reach_m: Sequence[float]
    prior: Array
    gradient: Array
    squares: float

    @property
    def open_robots(self) -> list[int]:
        """Robots whose noise is estimated."""
        return [k for k, noise in enumerate(self.stated) if noise is None]

    def sigmas(self, logs: Array) -> SceneSigmas:
        """Sigmas from logarithms: of image points, then of shift and turn of each open robot."""
        by_robot = [np.ones(6) if noise is None else np.asarray(noise) for noise in self.stated]
        for at, k in enumerate(self.open_robots):
            by_robot[k] = np.exp(np.repeat(logs[1 + 2 * at : 3 + 2 * at], 3))
        return SceneSigmas(float(np.exp(logs[0])), np.array(by_robot)[self.fit.views.stop_robot].reshape(-1, 6))

    def negative_log_likelihood(self, logs: Array) -> float:
        """Minus twice the log likelihood, and that of what is expected beforehand."""
        sigmas = self.sigmas(logs)
        information = self.fit.pixel_information / sigmas.sigma_px**2 + self.prior
        own = scene_columns(self.fit.views, self.fit.state.lenses).errors
        at = np.arange(own.start, own.stop)
        information[at, at] += (1 / sigmas.stop_sigma**2).ravel()
        try:
            root = np.linalg.cholesky(information)
        except np.linalg.LinAlgError:
            return _IMPOSSIBLE
        gain = np.linalg.solve(root, self.gradient / sigmas.sigma_px**2)
        freedoms = 2 * len(self.fit.tracks) - 3 * self.fit.tracks.count
        of_noise = 2 * freedoms * logs[0] + 2 * np.log(sigmas.stop_sigma).sum() + 2 * np.log(np.diag(root)).sum()
        return float(of_noise + self.squares / sigmas.sigma_px**2 - gain @ gain + self._prior_cost(logs))

    def _prior_cost(self, logs: Array) -> float:
        """Prior cost of the logarithms of robots' sigmas."""
        mean, factor = np.log(ROBOT_RAD)
        total = 0.0
        for at, k in enumerate(self.open_robots):
            shift, turn = logs[1 + 2 * at : 3 + 2 * at]
            tied = (shift - turn - np.log(max(self.reach_m[k], 0.1))) / np.log(TIE)
            total += float(((turn - mean) / factor) ** 2 + tied**2)
        return total


def estimate_sigmas(fit: SceneFit, stop_noise: Sequence[Array | None], reach_m: Sequence[float]) -> SceneSigmas:
    """The most likely sigmas about an optimum.

    Args:
        fit: The optimum.
        stop_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.
        reach_m: Of each robot, how far its flange is from its base [m], root of the mean square.
    """
    likelihood = _likelihood(fit, stop_noise, reach_m)
    start = [np.log(fit.sigma_px)]
    for k in likelihood.open_robots:
        now = fit.stop_sigma[fit.views.stop_robot == k][0]
        start += [np.log(now[0]), np.log(now[3])]
    bounds = np.log([_PIXELS] + [_ROBOTS] * (2 * len(likelihood.open_robots)))
    options = {"ftol": _RELATIVE_DECREASE}
    found = minimize(
        likelihood.negative_log_likelihood, np.array(start), method="L-BFGS-B", bounds=bounds, options=options
    )
    return likelihood.sigmas(found.x)


def _likelihood(fit: SceneFit, stop_noise: Sequence[Array | None], reach_m: Sequence[float]) -> _Likelihood:
    columns = scene_columns(fit.views, fit.state.lenses)
    own = columns.errors
    prior = fit.information - fit.pixel_information / fit.sigma_px**2
    prior[own, own] = 0.0
    errors = np.zeros(columns.width)
    errors[own] = fit.state.errors.ravel()
    carried = fit.pixel_information @ errors
    residuals = residuals_px(fit.views, fit.tracks, fit.state)
    residuals = residuals[np.isfinite(residuals)]  # without points behind a camera, which the next round leaves out
    squares = float(np.sum(residuals**2) - 2 * fit.pixel_gradient @ errors + errors @ carried)
    return _Likelihood(fit, stop_noise, reach_m, prior, fit.pixel_gradient - carried, squares)
