"""Image points of unknown points to second order, the points eliminated.

J holds the derivatives of pixels to right tangents of cameras and to lenses, E those to points. The points are
eliminated as H = J'J - J'E (E'E)^-1 E'J. E'E is block diagonal, so that the points cost little however many they are.
Source: Triggs et al. 2000, section 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import cross_matrix

_RIDGE = 1e-6  # [1/m^2] of a point's information: keeps one at infinity regular


@dataclass(frozen=True, eq=False)
class PixelEquations:
    """Residuals of image points over their sigma, and derivatives.

    Attributes:
        residual: (n, 2); 0 if not seen.
        by_camera: (n, 2, 6) to the right tangent of the view's camera.
        by_lens: (n, 2, k) to the parameters of its lens, as many as the longest lens has.
        by_point: (n, 2, 3) to the point in `world` [1/m].
        seen: (n,) whether the point is in front of the camera.
    """

    residual: Array
    by_camera: Array
    by_lens: Array
    by_point: Array
    seen: BoolArray


def pixel_equations(views: SceneViews, tracks: Tracks, state: SceneState, weight: Array) -> PixelEquations:
    """The equations of all image points at a state; see `equations_of_points`."""
    camera_from_world = state.world_from_camera(views).inverse()
    return equations_of_points(tracks, views.camera, camera_from_world, state.lenses, state.points, weight)


def equations_of_points(
    tracks: Tracks, camera: IntArray, camera_from_world: SE3, lenses: Sequence[Camera], points: Array, weight: Array
) -> PixelEquations:
    """The equations of all image points.

    Args:
        tracks: The image points.
        camera: (v,) index of the camera of each view.
        camera_from_world: (v,) poses of the views.
        lenses: By camera.
        points: (p, 3) in the world [m].
        weight: (n,) 1 / sigma [1/px].
    """
    rotation = camera_from_world.rotation[tracks.view]
    at = (rotation @ points[tracks.point][..., None])[..., 0] + camera_from_world.translation[tracks.view]
    longest = max(len(lens.parameters) for lens in lenses)
    n = len(tracks)
    residual, by_place, by_lens = np.zeros((n, 2)), np.zeros((n, 2, 3)), np.zeros((n, 2, longest))
    camera = camera[tracks.view]
    for index, lens in enumerate(lenses):
        mine = np.flatnonzero(camera == index)
        pixels, by_place[mine], of_lens = lens.project_with_derivatives(at[mine], True)
        assert of_lens is not None
        by_lens[mine, :, : of_lens.shape[-1]] = of_lens
        residual[mine] = pixels - tracks.pixels[mine]
    seen = np.isfinite(residual).all(1) & (at[:, 2] > 0)
    scale = np.where(seen, weight, 0.0)[:, None, None]
    by_place, by_lens = (np.where(seen[:, None, None], each, 0.0) * scale for each in (by_place, by_lens))
    residual = np.where(seen[:, None], residual, 0.0) * scale[..., 0]
    by_camera = np.concatenate([-by_place, by_place @ cross_matrix(at)], -1)
    return PixelEquations(residual, by_camera, by_lens, by_place @ rotation, seen)


@dataclass(frozen=True, eq=False)
class ReducedEquations:
    """The sum over image points, points eliminated: by right tangents of cameras, then by lenses that are not fixed.

    Attributes:
        gradient: (6 v + k,).
        information: (6 v + k, 6 v + k).
    """

    gradient: Array
    information: Array


def reduced_equations(
    camera: IntArray, tracks: Tracks, equations: PixelEquations, lens_widths: Sequence[int]
) -> ReducedEquations:
    """The equations with the points eliminated.

    Args:
        camera: (v,) index of the camera of each view.
        tracks: The image points.
        equations: Theirs.
        lens_widths: By camera how many parameters of its lens are estimated, 0 or all.
    """
    v, points = len(camera), tracks.count
    whole, force = _point_blocks(tracks, equations, points)
    root = np.linalg.inv(np.linalg.cholesky(whole))
    solved = (root @ force[..., None])[..., 0]
    tie = (equations.by_camera.mT @ equations.by_point) @ root[tracks.point].mT
    ties = _ties(tracks, tie, v, points)
    across, lens_gradient, lens_information, by_view = _lens_sums(camera, tracks, equations, lens_widths, root)
    k = len(lens_gradient)
    information, gradient = np.zeros((6 * v + k, 6 * v + k)), np.zeros(6 * v + k)
    own = sums(tracks.view, v, equations.by_camera.mT @ equations.by_camera)
    for view in range(v):
        information[6 * view : 6 * view + 6, 6 * view : 6 * view + 6] = own[view]
    information[: 6 * v, : 6 * v] -= ties @ ties.T
    pull = sums(tracks.view, v, (equations.by_camera.mT @ equations.residual[..., None])[..., 0])
    gradient[: 6 * v] = pull.ravel() - ties @ solved.ravel()
    beside = by_view - ties @ across.T
    information[: 6 * v, 6 * v :], information[6 * v :, : 6 * v] = beside, beside.T
    information[6 * v :, 6 * v :] = lens_information - across @ across.T
    gradient[6 * v :] = lens_gradient - across @ solved.ravel()
    return ReducedEquations(gradient, information)


def point_steps(tracks: Tracks, equations: PixelEquations) -> Array:
    """Gauss-Newton steps of the points with cameras as they are, (p, 3) [m]."""
    whole, force = _point_blocks(tracks, equations, tracks.count)
    return np.asarray(-np.linalg.solve(whole, force[..., None])[..., 0])


def point_information(tracks: Tracks, equations: PixelEquations) -> Array:
    """Information about each point if the cameras are known, (p, 3, 3) [1/m^2]."""
    return _point_blocks(tracks, equations, tracks.count)[0]


def sums(index: IntArray, count: int, values: Array) -> Array:
    """Sums of values (n, ...) by index (n,), (count, ...)."""
    flat = values.reshape(len(values), -1)
    rows = sparse.csr_matrix((np.ones(len(index)), (index, np.arange(len(index)))), shape=(count, len(index)))
    return np.asarray(rows @ flat).reshape(count, *values.shape[1:])


def _point_blocks(tracks: Tracks, equations: PixelEquations, points: int) -> tuple[Array, Array]:
    """Information (p, 3, 3) and gradient (p, 3) of the points."""
    of = equations.by_point
    whole = sums(tracks.point, points, of.mT @ of) + _RIDGE * np.eye(3)
    return whole, sums(tracks.point, points, (of.mT @ equations.residual[..., None])[..., 0])


def _ties(tracks: Tracks, tie: Array, views: int, points: int) -> Array:
    """Ties of cameras to points, (6 v, 3 p), from those of each image point (n, 6, 3).

    Most are zero, but for the tens of views that people have a dense product is no slower than a sparse one.
    """
    dense = sums(tracks.view * points + tracks.point, views * points, tie).reshape(views, points, 6, 3)
    return np.moveaxis(dense, 2, 1).reshape(6 * views, 3 * points)


def _lens_sums(
    camera: IntArray, tracks: Tracks, equations: PixelEquations, widths: Sequence[int], root: Array
) -> tuple[Array, Array, Array, Array]:
    """Ties of lenses to points (k, 3 p), gradient (k,), information (k, k), and that with cameras (6 v, k)."""
    v, points = len(camera), tracks.count
    ends = np.cumsum([0, *widths])
    k = int(ends[-1])
    ties, gradient, information, beside = np.zeros((k, 3 * points)), np.zeros(k), np.zeros((k, k)), np.zeros((6 * v, k))
    of_points = camera[tracks.view]
    for index, width in enumerate(widths):
        mine = np.flatnonzero(of_points == index)
        if not width or not len(mine):
            continue
        rows, of = slice(ends[index], ends[index + 1]), equations.by_lens[mine, :, :width]
        tie = sums(tracks.point[mine], points, of.mT @ equations.by_point[mine]) @ root.mT
        ties[rows] = np.moveaxis(tie, 1, 0).reshape(width, 3 * points)
        gradient[rows] = np.einsum("nak,na->k", of, equations.residual[mine])
        information[rows, rows] = np.einsum("nak,nal->kl", of, of)
        beside[:, rows] = sums(tracks.view[mine], v, equations.by_camera[mine].mT @ of).reshape(6 * v, width)
    return ties, gradient, information, beside
