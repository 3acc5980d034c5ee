"""A lens from views of boards alone, where nothing is known of it.

`benchmarks.starts` judges its limits.
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
from basecal.numerics.levenberg_marquardt import Optima, Stop, levenberg_marquardt

_FOCAL_GUESSES = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
_MOST_VIEWS = 30
_MOST_POINTS = 100  # of a board: a start needs no more, and the lens is estimated of all of them afterwards
_CONVERGED_SHARE = 0.01  # of the residuals' norm: a step that gains less than 1e-4 of the cost is the last of a start
_RIDGE = 1e-9  # [1/m^2, 1/rad^2] for boards that hold no pose: nothing beside what a pixel tells of one that does


@dataclass(frozen=True, eq=False)
class _Lenses:
    """Lenses, (b,), and with each the boards' poses by target, (b, n)."""

    camera: Camera
    poses: tuple[SE3, ...]


def guessed_lens(camera: CellCamera, focal: float = 1.0) -> Camera:
    """A lens without distortion, centred, with a focal length of `focal` image widths.

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
    """The lens that explains views of boards best, each board posed freely.

    Several focal lengths are tried; the poses and the lens are refined together, first without distortion. Without
    a view of four points it is the guess of one image width.
    """
    usable = [_thin_points(m) for m in measurements]
    usable = [m for m in usable if len(m.seen)]
    if not usable:
        return guessed_lens(camera)
    guesses = [guessed_lens(camera, focal) for focal in _FOCAL_GUESSES]
    start = stack([_Lenses(lens, tuple(_poses(lens, m) for m in usable)) for lens in guesses])
    terms = np.arange(start.camera.parameters.shape[-1])
    rough = _refine_lenses(start, usable, 8, terms[:2])
    # Of a lens that bends much, what fits best without any bending is another focal length.
    bent = _refine_lenses(rough.state, usable, 12, terms[:5])
    best = take(bent.state, np.array([np.nan_to_num(bent.cost, nan=np.inf).argmin()]))
    return take(_refine_lenses(best, usable, 12, terms).state.camera, 0)


def _thin_points(measurement: PixelMeasurement) -> PixelMeasurement:
    enough = np.flatnonzero(measurement.seen.sum(-1) >= FEWEST_POINTS)
    step = max(1, -(-len(enough) // _MOST_VIEWS))
    few = measurement.take(enough[::step]).thin(_MOST_POINTS)
    return PixelMeasurement(few.points_in_target, few.pixels, few.seen, few.stated, few.seen.astype(np.float64))


def _poses(lens: Camera, measurement: PixelMeasurement) -> SE3:
    bearings, valid = lens.undistort(measurement.pixels)
    weight = measurement.weight * valid * float(lens.focal[0])
    chords = BearingMeasurement(measurement.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)
    found = view_poses(chords.points_in_target, chords.bearings_in_camera, measurement.seen & valid, chords)
    return found.camera_from_target[:, 0]


def _refine_lenses(
    start: _Lenses, measurements: Sequence[PixelMeasurement], iterations: int, free: NDArray[np.intp]
) -> Optima[_Lenses, _About]:
    """The lenses, of which some terms are free, and every view's pose at their optima."""
    return levenberg_marquardt(_Views(measurements, free), start, Stop(iterations, sigmas=_CONVERGED_SHARE))


@dataclass(frozen=True, eq=False)
class _About:
    """The terms of lenses that are free, (k,), to second order, with the views' poses eliminated.

    Attributes:
        cost: (b,).
        gradient: (b, k).
        hessian: (b, k, k).
        eliminated_cost: (b,) by how much the poses alone lower the cost.
        back: By target, (b, n, 6, k + 1): the poses' steps are minus its last column, and minus the others times those
            of the lens.
    """

    cost: Array
    gradient: Array
    hessian: Array
    eliminated_cost: Array
    back: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class _Views:
    """Views of boards, and which terms of the lens are free, as Levenberg-Marquardt knows them; see `System`."""

    measurements: Sequence[PixelMeasurement]
    kept: NDArray[np.intp]

    def linearise(self, state: _Lenses) -> _About:
        """See `System`."""
        views = [m.linearise(p, state.camera, True) for m, p in zip(self.measurements, state.poses, strict=True)]
        columns, b, k = 6 + self.kept, len(state.camera.parameters), len(self.kept)
        gradient, hessian, eliminated, back = np.zeros((b, k)), np.zeros((b, k, k)), np.zeros(b), []
        for view in views:
            mixed = view.information[..., :6, columns]
            right = np.concatenate([mixed, view.gradient[..., :6, None]], -1)
            back.append(np.linalg.solve(view.information[..., :6, :6] + _RIDGE * np.eye(6), right))
            carried = mixed.mT @ back[-1]
            hessian += (view.information[..., columns[:, None], columns] - carried[..., :-1]).sum(1)
            gradient += (view.gradient[..., columns] - carried[..., -1]).sum(1)
            eliminated += np.sum(view.gradient[..., :6] * back[-1][..., -1], axis=(1, 2))
        cost = np.sum([view.cost.sum(-1) for view in views], axis=0)
        return _About(cost, gradient, hessian, eliminated, tuple(back))

    def retract(self, state: _Lenses, model: _About, step: Array) -> _Lenses:
        """See `System`."""
        of_lens = np.zeros(state.camera.parameters.shape)
        of_lens[:, self.kept] = step
        steps = [-(back[..., -1] + (back[..., :-1] @ step[:, None, :, None])[..., 0]) for back in model.back]
        poses = tuple(pose @ SE3.exp(each) for pose, each in zip(state.poses, steps, strict=True))
        return _Lenses(retract_lens(state.camera, of_lens), poses)

    def take(self, rows: IntArray) -> _Views:
        """See `System`; all lenses are tried on the same views."""
        return self
