"""Priors of sigmas: log-normal, about those of devices of their kind, and wide.

Points in images: detectors find corners to 0.02 to 0.3 px (Geiger et al. 2012, Duda & Frese 2018). The error that all
points of a view of a board share is 1.1 to 5 times their scatter, on recordings of six real rigs.
Arms: repeatability by ISO 9283 is 0.01 to 0.1 mm. ABB IRB 120 has 0.01 mm, UR3e and UR5e 0.03 mm, Motoman MA1400
0.08 mm, KUKA LBR iiwa and Franka 0.1 mm. Accuracy without calibration is 0.5 to 2 mm (Nubiola & Bonev 2013): at a reach
of 0.6 m 0.02 to 3 mrad. Errors of joints are angles, so that those of a place are as large as its distance from the
base makes them. Errors that stops share are expected in proportion to those of single stops, term by term.
Stamps: cameras that are triggered and stamped by their own clock jitter by microseconds. Those stamped on arrival at a
computer jitter by 0.1 to 5 ms (Furgale et al. 2013 and the drivers of ROS).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from basecal.effects.faces.shared_errors import TIE, SharedPrior
from basecal.estimation.noise.mixed_model import MixedModel
from basecal.geometry import Array

# Mean and factor of one standard deviation, by field of `Noise`, where the points of views do not show their scatter.
_BY_ITSELF = {"pixel_px": (0.2, 5.0), "pose_m": (1e-3, 5.0), "pose_rad": (2e-3, 5.0), "point_m": (1e-3, 5.0)}
_BY_ITSELF |= {"touch_m": (2e-4, 4.0), "grip_rad": (1e-3, 4.0)}
# What a view gets wrong over what its points scatter: the middle of 1.1 to 5, and the factor that spans them.
_OVER_SCATTER = (2.0, 3.0)
_ENOUGH_SCATTER = 20  # freedoms that tell a sigma to a sixth, which is little beside that factor
# Nothing measures a point better than to a thousandth of a pixel; only made-up data do.
_LEAST_SCATTER = 5e-3
ROBOT_RAD = (3e-4, 4.0)  # [rad] the middle of 0.02 to 3 mrad, and the factor of a standard deviation that spans them
_ROBOTS_APART = 2.0  # factor between the robots of one cell, which are mostly of one make
_JITTER_S = (2e-4, 5.0)  # [s] the middle of them, and the factor of a standard deviation


@dataclass(frozen=True, eq=False)
class LogNormals:
    """Independent normals of linear forms of the logarithms: `forms` (r, k), `mean` (r,), `sigma` (r,)."""

    forms: Array
    mean: Array
    sigma: Array

    def value(self, logs: Array) -> tuple[float, Array]:
        """Minus twice the log density but for that of the forms' determinant, and its slope, (k,)."""
        z = np.asarray((self.forms @ logs - self.mean) / self.sigma, dtype=np.float64)
        return float(z @ z + np.log(2 * np.pi * self.sigma**2).sum()), 2 * self.forms.T @ (z / self.sigma)

    @property
    def curvature(self) -> Array:
        """(k, k) second derivative of `value`, everywhere."""
        scaled = self.forms / self.sigma[:, None]
        return np.asarray(2 * scaled.T @ scaled, dtype=np.float64)

    @property
    def start(self) -> Array:
        """The logarithms expected beforehand, (k,)."""
        return np.asarray(np.linalg.solve(self.forms, self.mean), dtype=np.float64)


def hyperpriors(model: MixedModel, reach_m: Mapping[str, float], kinds: Sequence[SharedPrior] = ()) -> LogNormals:
    """Priors of a model's sigmas.

    Args:
        model: The model.
        reach_m: How far each robot's flange is from its base, root of the mean square [m].
        kinds: Of errors that stops share.
    """
    forms, places = np.eye(model.sigmas.count), model.sigmas
    rows: list[tuple[Array, float, float]] = []
    for key, at in places.views.items():
        mean, factor = _part_prior(key[1], *model.white[key])
        rows.append((forms[at], np.log(mean), factor))
    tie = kinds[0].tie if kinds else TIE
    single = {robot: forms[at] for robot, at in places.stops.items()}
    for robot, (shift, turn) in single.items():
        rows.append((shift - turn, np.log(max(reach_m[robot], 0.1)), np.log(tie)))
    rows += _pool_robots([turn for _, turn in single.values()], ROBOT_RAD)
    for at in places.jitter.values():
        rows.append((forms[at], np.log(_JITTER_S[0]), np.log(_JITTER_S[1])))
    for prior, of_kind in zip(kinds, places.shared, strict=True):
        rows += _common_forms(reach_m, prior, {robot: forms[at] for robot, at in of_kind.items()}, single)
    return LogNormals(
        np.array([r[0] for r in rows]).reshape(-1, places.count), *(np.array([r[i] for r in rows]) for i in (1, 2))
    )


def _common_forms(
    reach_m: Mapping[str, float], common: SharedPrior, shared_logs: Mapping[str, Array], single: Mapping[str, Array]
) -> list[tuple[Array, float, float]]:
    """Forms (2, k) of shift and turn of the shared sigmas, by robot, and those of its single stops."""
    rows = []
    lever_m, factor = common.lever
    for robot, (shift, turn) in shared_logs.items():
        at = max(reach_m[robot], 0.1) if lever_m is None else lever_m
        rows.append((shift - turn, float(np.log(at)), float(np.log(factor))))
    if not common.is_over_stop:
        return rows + _pool_robots([turn for _, turn in shared_logs.values()], common.turn)
    mean, factor = np.log(common.turn)
    return rows + [(turn - single[robot][1], float(mean), float(factor)) for robot, (_, turn) in shared_logs.items()]


def _part_prior(field: str, squares: float, freedoms: float) -> tuple[float, float]:
    """Mean, and sigma of the logarithm: by the scatter of points about their view's own pose, where it shows."""
    if freedoms < _ENOUGH_SCATTER:
        mean, factor = _BY_ITSELF[field]
        return mean, float(np.log(factor))
    over, factor = _OVER_SCATTER
    scatter = max(float(np.sqrt(squares / freedoms)), _LEAST_SCATTER * _BY_ITSELF[field][0])
    return over * scatter, float(np.hypot(np.log(factor), (2 * freedoms) ** -0.5))


def _pool_robots(forms: Sequence[Array], sigma: tuple[float, float]) -> list[tuple[Array, float, float]]:
    """Robots of one cell are more similar than any two: a common part, and one of each."""
    n = len(forms)
    if not n:
        return []
    own = np.log(_ROBOTS_APART) ** 2
    common = np.log(sigma[1]) ** 2 - own
    root = np.linalg.cholesky(common + own * np.eye(n))
    inverse = np.linalg.inv(root)
    scale = 1 / np.diag(inverse)
    mean = np.log(sigma[0])
    return [
        (s * row @ np.stack(forms), float(mean * (s * row).sum()), float(s))
        for s, row in zip(scale, inverse, strict=True)
    ]
