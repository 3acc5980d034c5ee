"""Priors of sigmas: wide log-normal distributions about values of typical devices.

Points in images: detectors find corners to 0.02 to 0.3 px (Geiger et al. 2012, Duda & Frese 2018). The error that all
points of a view of a board share is 1.1 to 5 times their scatter, in recordings of six real rigs.
Arms: repeatability by ISO 9283 is 0.01 to 0.1 mm. ABB IRB 120 has 0.01 mm, UR3e and UR5e 0.03 mm, Motoman MA1400
0.08 mm, KUKA LBR iiwa and Franka 0.1 mm. Accuracy without calibration is 0.5 to 2 mm (Nubiola & Bonev 2013). At a reach
of 0.6 m, the range is 0.02 to 3 mrad. Joint errors are angles, so position errors grow with the distance from the base.
Shared errors are expected in proportion to the errors of single stops, separately for each effect.
Time stamps: images triggered and stamped by the camera's own clock have microseconds of jitter. Images stamped on
arrival at a computer have 0.1 to 5 ms (Furgale et al. 2013 and the drivers of ROS).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.effects.faces.shared_errors import TIE, SharedPrior
from basecal.estimation.noise.mixed_model import MixedModel
from basecal.geometry import Array

# Mean and factor of one standard deviation, by field of `Noise`, if the scatter of points within views is unknown.
_TYPICAL_SIGMAS = {"pixel_px": (0.2, 5.0), "pose_m": (1e-3, 5.0), "pose_rad": (2e-3, 5.0), "point_m": (1e-3, 5.0)}
_TYPICAL_SIGMAS |= {"touch_m": (2e-4, 4.0), "grip_rad": (1e-3, 4.0)}
# Error of a view relative to the scatter of its points: the middle of 1.1 to 5, and a factor that covers this range.
_OVER_SCATTER = (2.0, 3.0)
_ENOUGH_SCATTER = 20  # degrees of freedom that determine a sigma to a sixth, which is small relative to that factor
# Smallest scatter relative to the mean above, 0.001 px: only synthetic data have less.
_LEAST_SCATTER = 5e-3
ROBOT_RAD = (3e-4, 4.0)  # [rad] the middle of 0.02 to 3 mrad, and the factor of one standard deviation
_ROBOT_SPREAD = 2.0  # factor of one standard deviation between the robots of a cell, mostly of the same type
_JITTER_S = (2e-4, 5.0)  # [s] mean, and the factor of one standard deviation


@dataclass(frozen=True, eq=False)
class LogNormals:
    """Independent normal priors of linear combinations of logarithms: `forms` (r, k), `mean` (r,), `sigma` (r,)."""

    forms: Array
    mean: Array
    sigma: Array

    def value(self, logs: Array) -> tuple[float, Array]:
        """Minus twice the log density, without the determinant of the forms, and its gradient, (k,)."""
        z = np.asarray((self.forms @ logs - self.mean) / self.sigma, dtype=np.float64)
        return float(z @ z + np.log(2 * np.pi * self.sigma**2).sum()), 2 * self.forms.T @ (z / self.sigma)

    @property
    def curvature(self) -> Array:
        """Second derivative of `value`, which is constant, (k, k)."""
        scaled = self.forms / self.sigma[:, None]
        return np.asarray(2 * scaled.T @ scaled, dtype=np.float64)

    @property
    def start(self) -> Array:
        """Prior means of the logarithms, (k,)."""
        return np.asarray(np.linalg.solve(self.forms, self.mean), dtype=np.float64)


def hyperpriors(
    model: MixedModel, reach_m: Mapping[str, float], shared_priors: Sequence[SharedPrior] = ()
) -> LogNormals:
    """Priors of a model's sigmas.

    Args:
        model: The model.
        reach_m: Distance of each robot's flange from its base, root mean square [m].
        shared_priors: Priors of each kind of shared errors.
    """
    forms, places = np.eye(model.sigmas.count), model.sigmas
    rows: list[tuple[Array, float, float]] = []
    for key, at in places.views.items():
        mean, factor = _part_prior(key[1], *model.white[key])
        rows.append((forms[at], np.log(mean), factor))
    tie = shared_priors[0].tie if shared_priors else TIE
    single = {robot: forms[at] for robot, at in places.stops.items()}
    for robot, (translation, rotation) in single.items():
        rows.append((translation - rotation, np.log(max(reach_m[robot], 0.1)), np.log(tie)))
    rows += _pool_robots([rotation for _, rotation in single.values()], ROBOT_RAD)
    for at in places.jitter.values():
        rows.append((forms[at], np.log(_JITTER_S[0]), np.log(_JITTER_S[1])))
    for prior, of_kind in zip(shared_priors, places.shared, strict=True):
        rows += _shared_rows(reach_m, prior, {robot: forms[at] for robot, at in of_kind.items()}, single)
    return LogNormals(
        np.array([r[0] for r in rows]).reshape(-1, places.count), *(np.array([r[i] for r in rows]) for i in (1, 2))
    )


def _shared_rows(
    reach_m: Mapping[str, float], prior: SharedPrior, shared_logs: Mapping[str, Array], single: Mapping[str, Array]
) -> list[tuple[Array, float, float]]:
    """Prior rows of shared sigmas: translation relative to rotation, and rotation, absolute or relative to stops.

    Args:
        reach_m: Distance of each robot's flange from its base, root mean square [m].
        prior: Prior of the shared errors.
        shared_logs: Forms of the logarithms of shared translation and rotation, (2, k), by robot.
        single: Forms of the logarithms of the robots' single stops, (2, k), by robot.
    """
    rows = []
    lever_m, factor = prior.lever
    for robot, (translation, rotation) in shared_logs.items():
        lever = max(reach_m[robot], 0.1) if lever_m is None else lever_m
        rows.append((translation - rotation, float(np.log(lever)), float(np.log(factor))))
    if not prior.is_over_stop:
        return rows + _pool_robots([rotation for _, rotation in shared_logs.values()], prior.turn)
    mean, factor = np.log(prior.turn)
    for robot, (_, rotation) in shared_logs.items():
        rows.append((rotation - single[robot][1], float(mean), float(factor)))
    return rows


def _part_prior(field: str, squares: float, freedoms: float) -> tuple[float, float]:
    """Prior mean of a sigma, and sigma of its logarithm: from the scatter of points within views, if it is known."""
    if freedoms < _ENOUGH_SCATTER:
        mean, factor = _TYPICAL_SIGMAS[field]
        return mean, float(np.log(factor))
    over, factor = _OVER_SCATTER
    scatter = max(float(np.sqrt(squares / freedoms)), _LEAST_SCATTER * _TYPICAL_SIGMAS[field][0])
    return over * scatter, float(np.hypot(np.log(factor), (2 * freedoms) ** -0.5))


def _pool_robots(forms: Sequence[Array], prior: tuple[float, float]) -> list[tuple[Array, float, float]]:
    """Prior rows that couple the robots of a cell: a common part of the logarithm, and a part of each robot."""
    n = len(forms)
    if not n:
        return []
    own = np.log(_ROBOT_SPREAD) ** 2
    common = np.log(prior[1]) ** 2 - own
    root = np.linalg.cholesky(common + own * np.eye(n))
    inverse = np.linalg.inv(root)
    scale = 1 / np.diag(inverse)
    mean = np.log(prior[0])
    return [
        (s * row @ np.stack(forms), float(mean * (s * row).sum()), float(s))
        for s, row in zip(scale, inverse, strict=True)
    ]
