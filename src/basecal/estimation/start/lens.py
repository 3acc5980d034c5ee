"""Start values of an unknown lens from views of boards alone.

The limits are validated by `benchmarks.starts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from basecal.cell import CellCamera
from basecal.errors import InputError
from basecal.estimation.least_squares.normal_equations import retract_lens
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import FEWEST_POINTS, view_poses
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.batch import stack, take
from basecal.numerics.levenberg_marquardt import Criteria, Optima, levenberg_marquardt

_FOCAL_GUESSES = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
_MOST_VIEWS = 30
_MOST_POINTS = 100  # per board: sufficient for a start, since the lens is estimated from all points afterwards
_CONVERGED_SHARE = 0.01  # of the residuals' norm: the search ends at a decrease below 1e-4 of the cost
_RIDGE = 1e-9  # [1/m^2, 1/rad^2] for boards without a unique pose: negligible relative to one pixel's information


@dataclass(frozen=True, eq=False)
class _Lenses:
    """Lenses, (b,), and the boards' poses with each lens, (b, n) by target."""

    camera: Camera
    poses: tuple[SE3, ...]


def guessed_lens(camera: CellCamera, focal: float = 1.0) -> Camera:
    """Return a centred lens without distortion, with a focal length of `focal` image widths.

    Raises:
        InputError: if the camera states no image size.
    """
    assert camera.intrinsics is not None
    if camera.size_px is None:
        raise InputError(f"{camera.name}: a free lens needs size_px, or fx, fy, cx, cy as a guess")
    width, height = camera.size_px
    parameters = [focal * width, focal * width, (width - 1) / 2, (height - 1) / 2, *[0.0] * camera.distortion_terms]
    return Camera(camera.model, np.array(parameters), camera.size_px)


def lens_from_views(camera: CellCamera, measurements: Sequence[PixelMeasurement]) -> Camera:
    """Estimate a lens from views of boards with free poses.

    Several focal lengths are tried. The poses and the lens are refined jointly, first without distortion. Without a
    view of at least four points, the result is `guessed_lens`.
    """
    usable = [_thin_points(m) for m in measurements]
    usable = [m for m in usable if len(m.seen)]
    if not usable:
        return guessed_lens(camera)
    guesses = [guessed_lens(camera, focal) for focal in _FOCAL_GUESSES]
    start = stack([_Lenses(lens, tuple(_poses(lens, m) for m in usable)) for lens in guesses])
    terms = np.arange(start.camera.parameters.shape[-1])
    undistorted = _refine_lenses(start, usable, 8, terms[:2])
    # With strong distortion, the best fit without distortion has a wrong focal length.
    distorted = _refine_lenses(undistorted.state, usable, 12, terms[:5])
    best = take(distorted.state, np.array([np.nan_to_num(distorted.cost, nan=np.inf).argmin()]))
    return take(_refine_lenses(best, usable, 12, terms).state.camera, 0)


def _thin_points(measurement: PixelMeasurement) -> PixelMeasurement:
    rows = np.flatnonzero(measurement.seen.sum(-1) >= FEWEST_POINTS)
    step = max(1, -(-len(rows) // _MOST_VIEWS))
    thinned = measurement.take(rows[::step]).thin(_MOST_POINTS)
    return PixelMeasurement(
        thinned.points_in_target, thinned.pixels, thinned.seen, thinned.stated, thinned.seen.astype(np.float64)
    )


def _poses(lens: Camera, measurement: PixelMeasurement) -> SE3:
    bearings, valid = lens.undistort(measurement.pixels)
    weight = measurement.weight * valid * float(lens.focal[0])
    weighted = BearingMeasurement(measurement.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)
    poses = view_poses(weighted.points_in_target, weighted.bearings_in_camera, measurement.seen & valid, weighted)
    return poses.camera_from_target[:, 0]


def _refine_lenses(
    start: _Lenses, measurements: Sequence[PixelMeasurement], iterations: int, free: NDArray[np.intp]
) -> Optima[_Lenses, _LensExpansion]:
    """Optimise the poses of all views and the free terms of the lenses."""
    return levenberg_marquardt(_BoardViews(measurements, free), start, Criteria(iterations, tolerance=_CONVERGED_SHARE))


@dataclass(frozen=True, eq=False)
class _LensExpansion:
    """Second-order expansion in the k free terms of the lenses, with the views' poses eliminated.

    Attributes:
        cost: (b,).
        gradient: (b, k).
        hessian: (b, k, k).
        eliminated_cost: (b,) decrease of the cost by the optimal step of the poses alone.
        back: (b, n, 6, k + 1) by target, for the back-substitution of poses. The last column is the negative step with
            a fixed lens. The others are its negative derivative with respect to the lens's step.
    """

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array
    back: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _BoardViews:
    """Views of boards and indices of the lens's free terms; implements `System` for Levenberg-Marquardt."""

    measurements: Sequence[PixelMeasurement]
    free: NDArray[np.intp]

    def linearise(self, state: _Lenses) -> _LensExpansion:
        """See `System`."""
        views = [m.linearise(p, state.camera, True) for m, p in zip(self.measurements, state.poses, strict=True)]
        columns, b, k = 6 + self.free, len(state.camera.parameters), len(self.free)
        gradient, hessian, eliminated, back = np.zeros((b, k)), np.zeros((b, k, k)), np.zeros(b), []
        for view in views:
            mixed = view.information[..., :6, columns]
            right = np.concatenate([mixed, view.gradient[..., :6, None]], -1)
            back.append(np.linalg.solve(view.information[..., :6, :6] + _RIDGE * np.eye(6), right))
            eliminated_part = mixed.mT @ back[-1]
            hessian += (view.information[..., columns[:, None], columns] - eliminated_part[..., :-1]).sum(1)
            gradient += (view.gradient[..., columns] - eliminated_part[..., -1]).sum(1)
            eliminated += np.sum(view.gradient[..., :6] * back[-1][..., -1], axis=(1, 2))
        cost = np.sum([view.cost.sum(-1) for view in views], axis=0)
        return _LensExpansion(cost, gradient, hessian, eliminated, tuple(back))

    def retract(self, state: _Lenses, model: _LensExpansion, step: Array) -> _Lenses:
        """See `System`."""
        lens_step = np.zeros(state.camera.parameters.shape)
        lens_step[:, self.free] = step
        steps = [-(back[..., -1] + (back[..., :-1] @ step[:, None, :, None])[..., 0]) for back in model.back]
        poses = tuple(pose @ SE3.exp(tangent) for pose, tangent in zip(state.poses, steps, strict=True))
        return _Lenses(retract_lens(state.camera, lens_step), poses)

    def take(self, rows: IntArray) -> _BoardViews:
        """See `System`; all lenses share the same views."""
        return self
