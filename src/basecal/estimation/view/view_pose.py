"""A target's pose in one view, from directions to its points: closed form, then maximum likelihood.

A plane seen from afar has two poses that look alike; both are given. Source: Zhang 2000 (homography), Hartley &
Zisserman 2004 (7.2, direct linear transform), Schweighofer & Pinz 2006 (the second pose).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from basecal.estimation.view.measurement import Measurement, ViewInformation
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import nearest_rotation, rotation_exp
from basecal.numerics.batch import concatenate
from basecal.numerics.levenberg_marquardt import Stop, levenberg_marquardt
from basecal.numerics.spectral import principal_axes

FEWEST_POINTS = 4  # points that determine the pose of a plane up to two
_FEWEST_IN_SPACE = 6  # points of the direct linear transform
_ITERATIONS = 2
_SETTLED = 1e-3  # of the residuals' norm: a step that gains less than a millionth of the cost is the last


@dataclass(frozen=True, eq=False)
class ViewPoses:
    """Poses of a target in each view.

    Attributes:
        camera_from_target: (n, 2) the best and the next best pose of each view; alike where there is only one.
        cost: (n, 2) sums of squared residuals; infinite where there is no pose.
        information: (n, 6, 6) of the best.
    """

    camera_from_target: SE3
    cost: Array
    information: Array

    @property
    def found(self) -> BoolArray:
        """(n,) whether the view has a pose at all."""
        return np.isfinite(self.cost[:, 0])


def view_poses(
    points_in_target: Array, bearings_in_camera: Array, seen: BoolArray, measurement: Measurement
) -> ViewPoses:
    """Poses of a target in each of its views.

    Args:
        points_in_target: (p, 3) [m].
        bearings_in_camera: (n, p, 3) unit.
        seen: (n, p).
        measurement: What is minimised: the views' bearings and sigmas.

    Returns:
        The poses; a cost is infinite in a view of fewer than four points.
    """
    centre = points_in_target.mean(0)
    flat, axes, size = _shape(points_in_target - centre)
    target_from_plane = SE3(axes, centre)
    local = (points_in_target - centre) @ axes / size
    guess = _direct_linear(local, bearings_in_camera, seen, flat)
    guess = SE3(guess.rotation, guess.translation * size)
    guesses = concatenate([guess, _tilted(guess)]) if flat else guess
    n = len(guess)
    twice = measurement.take(np.arange(len(guesses)) % n)
    poses = refined(twice, guesses @ target_from_plane.inverse(), iterations=_ITERATIONS)
    enough = seen.sum(-1) >= (FEWEST_POINTS if flat else _FEWEST_IN_SPACE)
    first, second = poses.of(slice(0, n)), poses.of(slice(len(guesses) - n, None))
    cost = np.stack([first.cost, second.cost], -1)
    order = np.argsort(cost, -1, kind="stable")
    row = np.arange(len(cost))[:, None]
    rotation = np.stack([first.camera_from_target.rotation, second.camera_from_target.rotation], 1)[row, order]
    translation = np.stack([first.camera_from_target.translation, second.camera_from_target.translation], 1)[row, order]
    information = np.stack([first.information, second.information], 1)[row[:, 0], order[:, 0]]
    cost = np.where(enough[:, None] & np.isfinite(cost[row, order]), cost[row, order], np.inf)
    return ViewPoses(SE3(rotation, translation), cost, information)


def _shape(centred: Array) -> tuple[bool, Array, float]:
    """Whether points lie in a plane, axes with z across it (a rotation), and their size [m]."""
    of = principal_axes(centred)
    axes = of.axes * np.array([1.0, 1.0, np.linalg.det(of.axes)])
    return of.dimension < 3, axes, float(np.sqrt(np.mean(np.sum(centred**2, -1))))


def _direct_linear(local: Array, bearings_in_camera: Array, seen: BoolArray, flat: bool) -> SE3:
    """The pose by the direct linear transform; of a plane by its homography, whose third axis is across the others."""
    places = local[:, :2] if flat else local
    homogeneous = np.concatenate([places, np.ones((len(places), 1))], -1)
    rows = _cross_rows(bearings_in_camera, seen, homogeneous)
    # The unit vector that these map nearest to zero.
    _, vectors = np.linalg.eigh(rows.mT @ rows)
    matrix = vectors[..., 0].reshape(len(rows), 3, -1)
    # Points lie along the bearings and not against them.
    along = np.einsum("nip,npi->np", matrix @ homogeneous.T, bearings_in_camera * seen[..., None])
    matrix = matrix * np.where(along.sum(-1) < 0, -1.0, 1.0)[:, None, None]
    axes = matrix[:, :, :-1]
    scale = np.linalg.norm(axes, axis=1).mean(-1) if flat else np.cbrt(np.abs(np.linalg.det(axes)))
    matrix = matrix / np.maximum(scale, 1e-12)[:, None, None]
    axes = matrix[:, :, :-1]
    if flat:
        axes = np.concatenate([axes, np.cross(axes[:, :, 0], axes[:, :, 1])[..., None]], -1)
    return SE3(nearest_rotation(axes), matrix[:, :, -1].copy())


def _cross_rows(bearings_in_camera: Array, seen: BoolArray, homogeneous: Array) -> Array:
    """Rows of b x (M h) = 0 in the entries of M by rows, (n, 3 p, 3 k), weighted by `seen`."""
    n, p, _ = bearings_in_camera.shape
    k = homogeneous.shape[-1]
    b = bearings_in_camera * seen[..., None]
    rows = np.zeros((n, p, 3, 3, k))
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        rows[:, :, i, m] = b[..., j, None] * homogeneous
        rows[:, :, i, j] = -b[..., m, None] * homogeneous
    return rows.reshape(n, 3 * p, 3 * k)


def _tilted(camera_from_plane: SE3) -> SE3:
    """The pose whose normal is mirrored at the line of sight: it looks the same through a long lens."""
    away = np.linalg.norm(camera_from_plane.translation, axis=-1, keepdims=True)
    sight = camera_from_plane.translation / np.maximum(away, 1e-12)
    normal = camera_from_plane.rotation[..., 2]
    normal = normal * np.where(np.sum(normal * sight, -1, keepdims=True) < 0, -1.0, 1.0)
    axis = np.cross(sight, normal)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, np.sum(normal * sight, -1, keepdims=True))
    turn = rotation_exp(-2 * angle * axis / np.maximum(sine, 1e-12))
    return SE3(turn @ camera_from_plane.rotation, camera_from_plane.translation.copy())


@dataclass(frozen=True, eq=False)
class _Refined:
    camera_from_target: SE3
    cost: Array
    information: Array

    def of(self, views: slice) -> _Refined:
        """The views of a slice."""
        return _Refined(self.camera_from_target[views], self.cost[views], self.information[views])


class Views(Protocol):
    """What says how views fit at poses; see `Measurement`."""

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """See `Measurement`."""
        ...

    def take(self, views: IntArray) -> Views:
        """See `Measurement`."""
        ...


@dataclass(frozen=True, eq=False)
class _Poses:
    """The poses of views, each a problem of its own, as Levenberg-Marquardt knows them; see `System`."""

    views: Views
    camera: Camera | None

    def linearise(self, camera_from_target: SE3) -> ViewInformation:
        """See `System`."""
        return self.views.linearise(camera_from_target, self.camera, False)

    def retract(self, camera_from_target: SE3, about: ViewInformation, step: Array) -> SE3:
        """See `System`."""
        return camera_from_target @ SE3.exp(step)

    def take(self, rows: IntArray) -> _Poses:
        """See `System`."""
        return _Poses(self.views.take(rows), self.camera)


def refined(views: Views, start: SE3, camera: Camera | None = None, iterations: int = 8) -> _Refined:
    """Each view's pose at its own optimum near `start`, (n,); see `numerics.levenberg_marquardt`."""
    optima = levenberg_marquardt(_Poses(views, camera), start, Stop(iterations, sigmas=_SETTLED))
    return _Refined(optima.state, optima.cost, optima.about.information)
