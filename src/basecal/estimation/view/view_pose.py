"""Estimate a target's pose in single views from directions to its points: closed form, then maximum likelihood.

A distant plane has two poses with almost equal images; both are returned. Source: Zhang 2000 (homography), Hartley &
Zisserman 2004 (7.2, direct linear transform), Schweighofer & Pinz 2006 (the second pose).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import Measurement, ViewInformation
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import cross, lengths, nearest_rotation, with_identity
from basecal.numerics.batch import choose_entries, concatenate, take
from basecal.numerics.levenberg_marquardt import Criteria, levenberg_marquardt
from basecal.numerics.spectral import principal_axes, smallest_vectors

FEWEST_3D_POINTS = 3  # 3-D points that determine a pose, unless they are collinear
FEWEST_POINTS = 4  # points that determine the pose of a plane, up to two solutions
_FEWEST_IN_SPACE = 6  # points needed by the direct linear transform
_REFINEMENT_STEPS = 2
_MOST_STEPS = 20  # most steps of one view: bounds the time of a pose that does not converge; assumed
_CONVERGED_GAIN = 1e-3  # relative to the residual norm: a step with a gain below a millionth of the cost is the last


@dataclass(frozen=True, eq=False)
class ViewPoses:
    """Poses of a target in each view.

    Attributes:
        camera_from_target: (n, 2) best and second-best pose of each view; equal if there is only one.
        cost: (n, 2) sums of squared residuals; infinite if there is no pose.
        information: (n, 6, 6) information of the best pose.
    """

    camera_from_target: SE3
    cost: Array
    information: Array

    @property
    def has_pose(self) -> BoolArray:
        """Whether each view has a pose, (n,)."""
        return np.isfinite(self.cost[:, 0])


def view_poses(
    points_in_target: Array,
    bearings_in_camera: Array,
    is_visible: BoolArray,
    measurement: Measurement,
    iterations: int = _REFINEMENT_STEPS,
) -> ViewPoses:
    """Estimate the poses of a target in each view.

    Args:
        points_in_target: (p, 3) [m].
        bearings_in_camera: (n, p, 3) unit directions.
        is_visible: (n, p) whether the point was seen.
        measurement: Measurement whose cost is minimised: bearings and sigmas of the views.
        iterations: Steps of refinement after the closed form; 0 returns the closed form.

    Returns:
        The poses; costs are infinite in views with too few points: four of a plane, six of other targets.
    """
    centre = points_in_target.mean(0)
    centred = points_in_target - centre
    principal = principal_axes(centred)
    is_flat, size = principal.dimension < 3, float(np.sqrt(np.mean(np.sum(centred**2, -1))))
    # A rotation, with z normal to the plane of a flat target.
    axes = principal.axes * np.array([1.0, 1.0, np.linalg.det(principal.axes)])
    plane_from_target = SE3.adopt(axes, centre).inverse()
    local = centred @ axes / size
    guess = _direct_linear(local, bearings_in_camera, is_visible, is_flat)
    guess = SE3.adopt(guess.rotation, guess.translation * size)
    guesses = concatenate([guess, _mirror_normal(guess)]) if is_flat else guess
    n = len(guess)
    both_measurements = measurement.take(np.arange(len(guesses)) % n)
    poses = refine_poses(both_measurements, guesses @ plane_from_target, iterations=iterations)
    has_enough = is_visible.sum(-1) >= (FEWEST_POINTS if is_flat else _FEWEST_IN_SPACE)
    first, second = take(poses, slice(0, n)), take(poses, slice(len(guesses) - n, None))
    is_swapped = ~(first.cost <= second.cost) & ~np.isnan(second.cost)
    best, next_best = choose_entries(is_swapped, second, first), choose_entries(is_swapped, first, second)
    cost = np.stack([best.cost, next_best.cost], -1)
    cost = np.where(has_enough[:, None] & np.isfinite(cost), cost, np.inf)
    best_two = [best.camera_from_target, next_best.camera_from_target]
    stacked = SE3.adopt(np.stack([p.rotation for p in best_two], 1), np.stack([p.translation for p in best_two], 1))
    return ViewPoses(stacked, cost, best.information)


def _direct_linear(local: Array, bearings_in_camera: Array, is_visible: BoolArray, is_flat: bool) -> SE3:
    """Poses by the direct linear transform, (n,); for a plane by its homography, with the third axis as a normal."""
    coordinates = local[:, :2] if is_flat else local
    homogeneous = np.column_stack([coordinates, np.ones(len(coordinates))])
    bearings = bearings_in_camera * is_visible[..., None]
    matrix = smallest_vectors(_squared_distances(bearings, homogeneous)).reshape(len(bearings), 3, -1)
    # Points are in the direction of the bearings, not opposite.
    sign = np.einsum("nia,nia->n", matrix, bearings.mT @ homogeneous)
    matrix[sign < 0] = -matrix[sign < 0]
    axes = matrix[:, :, :-1]
    scale = lengths(axes.mT).mean(-1) if is_flat else np.cbrt(np.abs(np.linalg.det(axes)))
    matrix = matrix / np.maximum(scale, 1e-12)[:, None, None]
    axes = matrix[:, :, :-1]
    if is_flat:
        axes = np.concatenate([axes, cross(axes[:, :, 0], axes[:, :, 1])[..., None]], -1)
    return SE3.adopt(nearest_rotation(axes), matrix[:, :, -1].copy())


def _squared_distances(bearings: Array, homogeneous: Array) -> Array:
    """Quadratic form in the entries of M, by rows, whose value is the sum of |b x (M h)|^2, (n, 3 k, 3 k).

    The quadratic form is the sum of (b'b I - b b') (x) h h'.

    Args:
        bearings: Bearings b, (n, p, 3), zero for points that are not seen.
        homogeneous: Homogeneous coordinates h, (p, k).
    """
    n, (p, k) = len(bearings), homogeneous.shape
    blocks = -bearings[..., :, None] * bearings[..., None, :]
    blocks = with_identity(blocks, np.einsum("npi,npi->np", bearings, bearings))
    products = (homogeneous[:, :, None] * homogeneous[:, None, :]).reshape(p, k * k)
    total = blocks.reshape(n, p, 9).mT @ products
    return np.asarray(total.reshape(n, 3, 3, k, k).swapaxes(2, 3).reshape(n, 3 * k, 3 * k))


def _mirror_normal(camera_from_plane: SE3) -> SE3:
    """Mirror the plane's normal at the line of sight: the second pose, which looks the same through a long lens.

    The plane is rotated by 180 deg about the normal n, then by 180 deg about the line of sight s. The rotation matrix
    is (2 s s' - I) (2 n n' - I). A plane at the camera's centre has no line of sight: its pose is kept.
    """
    normal, origin = camera_from_plane.rotation[..., 2], camera_from_plane.translation
    length = lengths(origin)[..., None]
    sight = np.divide(origin, length, out=normal.copy(), where=length > 1e-12)
    mirrored = 2 * np.einsum("...i,...i->...", normal, sight)[..., None] * sight - normal
    rotation = 2 * (mirrored[..., :, None] * normal[..., None, :] - sight[..., :, None] * sight[..., None, :])
    return SE3.adopt(with_identity(rotation, np.ones(len(rotation))) @ camera_from_plane.rotation, origin)


@dataclass(frozen=True, eq=False)
class _RefinedPoses:
    camera_from_target: SE3
    cost: Array
    information: Array


class Views(Protocol):
    """Views that can be linearised at poses; see `Measurement`."""

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`."""
        ...

    def take(self, views: IntArray) -> Views:
        """See `Measurement`."""
        ...


@dataclass(frozen=True, eq=False)
class _PoseProblem:
    """Poses of views as a `System` for Levenberg-Marquardt; each view is a separate problem of the batch."""

    views: Views
    camera: Camera | None

    def linearise(self, camera_from_target: SE3) -> ViewInformation:
        """See `System`."""
        return self.views.linearise(camera_from_target, self.camera, False)

    def retract(self, camera_from_target: SE3, model: ViewInformation, step: Array) -> SE3:
        """See `System`."""
        return camera_from_target @ SE3.exp(step)

    def take(self, rows: IntArray) -> _PoseProblem:
        """See `System`."""
        return _PoseProblem(self.views.take(rows), self.camera)


def refine_poses(
    views: Views, start: SE3, camera: Camera | None = None, iterations: int = _MOST_STEPS
) -> _RefinedPoses:
    """Refine the pose of each view separately, from initial poses (n,); see `numerics.levenberg_marquardt`."""
    if not iterations:
        view = views.linearise(start, camera, False)
        return _RefinedPoses(start, view.cost, view.information)
    optima = levenberg_marquardt(_PoseProblem(views, camera), start, Criteria(iterations, tolerance=_CONVERGED_GAIN))
    return _RefinedPoses(optima.state, optima.cost, optima.linearisation.information)


@dataclass(frozen=True, eq=False)
class PoseCache:
    """`view_poses` with a cache of results per view.

    Attributes:
        known: Poses of each view, a batch of one, by all data that they depend on.
    """

    known: dict[bytes, ViewPoses] = field(default_factory=dict)

    def __call__(
        self, points_in_target: Array, bearings_in_camera: Array, is_visible: BoolArray, measurement: BearingMeasurement
    ) -> ViewPoses:
        """See `view_poses`."""
        target = points_in_target.tobytes()
        views = zip(bearings_in_camera, is_visible, measurement.weight, strict=True)
        keys = [target + b.tobytes() + s.tobytes() + w.tobytes() for b, s, w in views]
        rows = np.array([row for row, key in enumerate(keys) if key not in self.known], dtype=np.int64)
        if len(rows):
            found = view_poses(points_in_target, bearings_in_camera[rows], is_visible[rows], measurement.take(rows))
            for k, row in enumerate(rows):
                self.known[keys[row]] = take(found, np.array([k]))
        return concatenate([self.known[key] for key in keys])
