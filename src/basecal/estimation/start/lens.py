"""A lens from views of boards alone, where nothing is known of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from basecal.cell import CellCamera
from basecal.estimation.least_squares.normal_equations import retract_lens
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import ViewInformation
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import FEWEST_POINTS, view_poses
from basecal.geometry import SE3, Array, Camera

_FOCAL_GUESSES = (0.5, 0.7, 1.0, 1.4, 2.0, 3.0)
_MOST_VIEWS = 30
_PIXEL_SCALE = 1e-3


@dataclass(frozen=True, eq=False)
class _Fit:
    camera: Camera
    poses: list[SE3]
    cost: float


def guessed_lens(camera: CellCamera, focal: float = 1.0) -> Camera:
    """A lens without distortion, centred, with a focal length of `focal` image widths."""
    assert camera.intrinsics is not None
    width, height = camera.size_px or (1280, 720)
    parameters = [focal * width, focal * width, (width - 1) / 2, (height - 1) / 2, *[0.0] * camera.distortion_terms]
    return Camera(camera.model, np.array(parameters), camera.size_px)


def lens_from_views(camera: CellCamera, measurements: Sequence[PixelMeasurement]) -> Camera:
    """The lens that explains views of boards best, each board posed freely.

    Several focal lengths are tried; the poses and the lens are refined together, first without distortion. Without
    a view of four points it is the guess of one image width.
    """
    usable = [_thinned(m) for m in measurements]
    usable = [m for m in usable if len(m.seen)]
    if not usable:
        return guessed_lens(camera)
    rough = [_fit(guessed_lens(camera, f), usable, 8, _without_distortion) for f in _FOCAL_GUESSES]
    best = min(rough, key=lambda fit: fit.cost)
    return _refine(_refine(best, usable, 12, _radial), usable, 12, _everything).camera


def _thinned(measurement: PixelMeasurement) -> PixelMeasurement:
    enough = np.flatnonzero(measurement.seen.sum(-1) >= FEWEST_POINTS)
    step = max(1, -(-len(enough) // _MOST_VIEWS))
    few = measurement.take(enough[::step])
    return PixelMeasurement(few.points_in_target, few.pixels, few.seen, few.stated, few.seen.astype(np.float64))


def _without_distortion(terms: int) -> Array:
    return np.array([1.0, 1, 0, 0] + [0.0] * terms)


def _radial(terms: int) -> Array:
    return np.array([1.0, 1, 1, 1] + [1.0] * min(terms, 1) + [0.0] * max(terms - 1, 0))


def _everything(terms: int) -> Array:
    return np.ones(4 + terms)


def _fit(camera: Camera, measurements: list[PixelMeasurement], iterations: int, mask: object) -> _Fit:
    poses = []
    for m in measurements:
        bearings, valid = camera.undistort(m.pixels)
        weight = m.weight * valid * float(camera.focal[0])
        chords = BearingMeasurement(m.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)
        poses.append(
            view_poses(m.points_in_target, chords.bearings_in_camera, m.seen & valid, chords).camera_from_target[:, 0]
        )
    return _refine(_Fit(camera, poses, np.inf), measurements, iterations, mask)


def _refine(fit: _Fit, measurements: list[PixelMeasurement], iterations: int, mask: object) -> _Fit:
    """Damped Gauss-Newton on the lens and every view's pose, the poses eliminated view by view."""
    assert callable(mask)
    kept = np.flatnonzero(mask(len(fit.camera.distortion)))
    views = _linearised(fit.camera, fit.poses, measurements)
    cost, damping = _cost(views), 1e-3
    for _ in range(iterations):
        lens_step, pose_steps = _step(views, kept, damping)
        camera = retract_lens(fit.camera, lens_step)
        poses = [p @ SE3.exp(step) for p, step in zip(fit.poses, pose_steps, strict=True)]
        candidate = _linearised(camera, poses, measurements)
        if _cost(candidate) <= cost:
            done = cost - _cost(candidate) < _PIXEL_SCALE * cost
            fit, views, cost, damping = _Fit(camera, poses, _cost(candidate)), candidate, _cost(candidate), damping / 10
            if done:
                break
        else:
            damping *= 10
    return _Fit(fit.camera, fit.poses, cost)


def _linearised(camera: Camera, poses: list[SE3], measurements: list[PixelMeasurement]) -> list[ViewInformation]:
    return [m.linearise(p, camera, True) for m, p in zip(measurements, poses, strict=True)]


def _cost(views: list[ViewInformation]) -> float:
    return float(sum(v.cost.sum() for v in views))


def _step(views: list[ViewInformation], kept: NDArray[np.intp], damping: float) -> tuple[Array, list[Array]]:
    width = views[0].gradient.shape[-1] - 6
    hessian, gradient = np.zeros((width, width)), np.zeros(width)
    solved = []
    for view in views:
        pose = view.information[:, :6, :6]
        pose = pose * (1 + damping * np.eye(6)) + 1e-9 * np.eye(6)
        mixed = view.information[:, :6, 6:]
        back = np.linalg.solve(pose, np.concatenate([mixed, view.gradient[:, :6, None]], -1))
        solved.append(back)
        hessian += (view.information[:, 6:, 6:] - np.swapaxes(mixed, -1, -2) @ back[..., :-1]).sum(0)
        gradient += (view.gradient[:, 6:] - (np.swapaxes(mixed, -1, -2) @ back[..., -1:])[..., 0]).sum(0)
    lens = np.zeros(width)
    reduced = hessian[np.ix_(kept, kept)]
    reduced = reduced + np.diag(damping * np.diag(reduced) + 1e-12)
    lens[kept] = -np.linalg.solve(reduced, gradient[kept])
    return lens, [-(back[..., -1] + back[..., :-1] @ lens) for back in solved]
