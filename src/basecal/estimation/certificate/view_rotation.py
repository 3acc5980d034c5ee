"""Lower bound of a view's cost as a function of the angle from the view's own optimal rotation.

At an angle from the optimal rotation of a view, and for any translation, its cost is at least
`constant + weight * sin^2(angle / 2)`. For measured poses and 3-D points this bound holds for all angles. For pixels
it uses half the curvature at the view's own optimum, and the view counts only if its second pose is excluded.
Source: docs/mathematics.md (10.1).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.errors import InputError
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import FEWEST_POINTS, refine_poses, view_poses
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import rotation_log
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_SAME_RAD = 1e-3  # poses of one optimum differ by rounding, two optima by far more [rad]
_CURVATURE_SHARE = 0.5  # share of the curvature at the optimum that is used as the growth of the cost farther away


class ViewCosts(NamedTuple):
    """Lower bounds of the costs of n views.

    Attributes:
        camera_from_target: (n,) optimal pose of each view alone.
        constant: (n,) least cost of each view.
        weight: (n,) the cost exceeds `constant` by at least `weight * sin^2(angle / 2)`; 0 if there is no bound.
        second: (n,) cost of the second-best pose of each view; infinite if there is none.
    """

    camera_from_target: SE3
    constant: Array
    weight: Array
    second: Array

    def without_doubtful(self, slack: float) -> ViewCosts:
        """Return a copy with zero weight for views whose second pose costs at most `slack` more than the best."""
        return self._replace(weight=np.where(self.second - self.constant > slack, self.weight, 0.0))


def view_costs(problem: Problem, state: State, group: ViewGroup) -> ViewCosts:
    """Lower bounds of the costs of a group's views at any pose.

    Args:
        problem: Problem, with the noise in use.
        state: State, whose lenses are assumed exact and whose poses are initial guesses of the views' poses.
        group: The views.
    """
    measurement = group.measurement
    if isinstance(measurement, PoseMeasurement):
        least = measurement.least_rotation_weight()
        return _constant_costs(measurement.measured_camera_from_target, np.zeros(len(least)), 4 * least**2)
    if isinstance(measurement, PointMeasurement):
        return _point_costs(measurement)
    if not isinstance(measurement, PixelMeasurement):
        raise InputError(f"views of {group.target} are {type(measurement).__name__}s, expected pixels, poses or points")
    return _pixel_costs(measurement, state.camera_from_target(group, problem.stops), state.cameras[group.camera])


def _constant_costs(camera_from_target: SE3, constant: Array, weight: Array) -> ViewCosts:
    return ViewCosts(camera_from_target, constant, weight, np.full(len(constant), np.inf))


def _point_costs(measurement: PointMeasurement) -> ViewCosts:
    """Lower bounds of the costs of views of 3-D points.

    A rotation by Q increases the cost by 2 tr(H (I - Q)), at least by 4 (h1 + h2) sin^2(angle / 2). h1 and h2 are the
    two smallest eigenvalues of H. Source: Umeyama 1991.
    """
    square = measurement.weight**2
    share = square / np.maximum(square.sum(-1, keepdims=True), 1e-300)
    p = measurement.points_in_target - (share @ measurement.points_in_target)[:, None]
    q = measurement.points_in_camera - np.einsum("np,npi->ni", share, measurement.points_in_camera)[:, None]
    u, s, vt = np.linalg.svd(np.einsum("np,npi,npj->nij", square, q, p))
    s[:, 2] *= np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    spread = np.einsum("np,npi,npi->n", square, p, p) + np.einsum("np,npi,npi->n", square, q, q)
    pose = SE3(u @ vt, np.zeros((len(u), 3)))
    return _constant_costs(pose, np.maximum(spread - 2 * s.sum(-1), 0.0), 4 * np.maximum(s[:, 1] + s[:, 2], 0.0))


def _pixel_costs(measurement: PixelMeasurement, camera_from_target: SE3, camera: Camera) -> ViewCosts:
    n = len(camera_from_target)
    bearings, valid = camera.undistort(measurement.pixels)
    seen = measurement.seen & (measurement.weight > 0) & valid
    if seen.shape[1] < FEWEST_POINTS or not seen.any():
        return _constant_costs(camera_from_target, np.zeros(n), np.zeros(n))
    bearings = np.where(seen[..., None], bearings, 0.0)
    chords = BearingMeasurement(
        measurement.points_in_target, bearings, np.where(seen, measurement.weight, 0.0) * float(camera.focal.mean())
    )
    poses = view_poses(measurement.points_in_target, bearings, seen, chords)
    own = replace(measurement, weight=np.where(seen, measurement.weight, 0.0), seen=seen)
    starts = [poses.camera_from_target[:, 0], poses.camera_from_target[:, 1], camera_from_target]
    ends = [refine_poses(own, start, camera) for start in starts]
    costs = np.nan_to_num(np.stack([end.cost for end in ends]), nan=np.inf)
    rows, best = np.arange(n), np.argmin(costs, axis=0)
    rotation = np.stack([end.camera_from_target.rotation for end in ends])
    translation = np.stack([end.camera_from_target.translation for end in ends])
    information = np.stack([end.information for end in ends])[best, rows]
    angles = np.linalg.norm(rotation_log(rotation[best, rows].mT @ rotation), axis=-1)
    second = np.where(angles > _SAME_RAD, costs, np.inf).min(0)
    has_optimum = poses.has_pose & np.isfinite(costs[best, rows])
    weight = np.where(has_optimum, 4 * _CURVATURE_SHARE * _rotation_curvature(information), 0.0)
    pose = SE3(rotation[best, rows], translation[best, rows])
    return ViewCosts(pose, np.where(has_optimum, costs[best, rows], 0.0), weight, second)


def _rotation_curvature(information: Array) -> Array:
    """Least curvature of the cost over rotations, with optimal translation, (n,)."""
    across = information[:, :3, 3:]
    translation_covariance = spectrum(information[:, :3, :3], VIEW_ROUNDING).inverse
    reduced: Array = information[:, 3:, 3:] - across.mT @ translation_covariance @ across
    least: Array = np.maximum(np.linalg.eigvalsh(reduced)[:, 0], 0.0)
    return least
