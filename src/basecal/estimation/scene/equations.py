"""Normal equations of image points of unknown scene points, with the points eliminated (Schur complement).

J is the Jacobian of the pixels with respect to right tangents of cameras and to lenses, E that with respect to points.
The points are eliminated as H = J'J - J'E (E'E)^-1 E'J. E'E is block diagonal, so the cost is linear in the number of
points. Source: Triggs et al. 2000, section 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import SceneViews, Tracks
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.geometry.rotation import cross_matrix
from basecal.numerics.group_sums import GroupSums

_RIDGE = 1e-6  # [1/m^2] added to a point's information: keeps points at infinity regular


@dataclass(frozen=True, eq=False)
class PixelEquations:
    """Residuals of image points in sigmas, with derivatives.

    Attributes:
        residual: (n, 2) residuals; 0 for points behind the camera.
        by_view: (n, 2, 6 + k) derivative with respect to the right tangent of the view's camera, then to its lens. k is
            the largest number of lens parameters.
        by_point: (n, 2, 3) derivative with respect to the point in `world` [1/m].
        seen: (n,) whether the point is in front of the camera.
    """

    residual: Array
    by_view: Array
    by_point: Array
    seen: BoolArray

    def scale(self, factor: Array) -> PixelEquations:
        """Multiply each equation by a factor, (n, 1)."""
        wide = factor[..., None]
        return PixelEquations(self.residual * factor, self.by_view * wide, self.by_point * wide, self.seen)


def pixel_equations(views: SceneViews, tracks: Tracks, state: SceneState, weight: float) -> PixelEquations:
    """Equations of all image points at a state; see `equations_of_points`."""
    camera_from_world = state.world_from_camera(views).inverse()
    return equations_of_points(tracks, views.camera, camera_from_world, state.lenses, state.points, weight)


def equations_of_points(
    tracks: Tracks, camera: IntArray, camera_from_world: SE3, lenses: Sequence[Camera], points: Array, weight: float
) -> PixelEquations:
    """Linearise the reprojection errors of all image points.

    Args:
        tracks: The image points.
        camera: (v,) index of the camera of each view.
        camera_from_world: (v,) poses of the views.
        lenses: Lens of each camera.
        points: (p, 3) in the world [m].
        weight: 1 / sigma [1/px].
    """
    rotation = camera_from_world.rotation[tracks.view]
    points_in_camera = (rotation @ points[tracks.point][..., None])[..., 0] + camera_from_world.translation[tracks.view]
    n, longest = len(tracks), max(len(lens.parameters) for lens in lenses)
    pixels, by_camera_point, by_view = np.zeros((n, 2)), np.zeros((n, 2, 3)), np.zeros((n, 2, 6 + longest))
    camera = camera[tracks.view]
    for index, lens in enumerate(lenses):
        rows = np.flatnonzero(camera == index)
        pixels[rows], by_camera_point[rows], by_lens = lens.project_with_derivatives(points_in_camera[rows], True)
        assert by_lens is not None
        by_view[rows, :, 6 : 6 + by_lens.shape[-1]] = by_lens
    by_view[..., :6] = np.concatenate([-by_camera_point, by_camera_point @ cross_matrix(points_in_camera)], -1)
    residual, by_point = pixels - tracks.pixels, by_camera_point @ rotation
    seen = np.isfinite(residual).all(1) & (points_in_camera[:, 2] > 0)
    for each in (residual, by_view, by_point):
        each[~seen] = 0.0
    return PixelEquations(residual, by_view, by_point, seen).scale(np.full((n, 1), weight))


def reduced_equations(
    camera: IntArray, tracks: Tracks, equations: PixelEquations, lens_widths: Sequence[int]
) -> tuple[Array, Array]:
    """Gradient (6 v + k,) and information (6 v + k, 6 v + k) of all image points, with the points eliminated.

    Columns are right tangents of cameras, then parameters of lenses that are not fixed.

    Args:
        camera: (v,) index of the camera of each view.
        tracks: The image points.
        equations: Equations of the image points.
        lens_widths: Number of estimated lens parameters of each camera, 0 or all.
    """
    information_of_points, gradient_of_points = _point_blocks(tracks, equations)
    root = np.linalg.inv(np.linalg.cholesky(information_of_points))
    coupling = equations.by_view.mT @ equations.by_point @ root[tracks.point].mT
    ends = np.cumsum([6 * len(camera), *lens_widths])
    width, own = int(ends[-1]), equations.by_view.shape[-1]
    # Columns of fixed lenses are placed last and cut off.
    lens_columns = np.where(np.diff(ends) > 0, ends[:-1], width)
    gradient, information = np.zeros(width + own), np.zeros((width + own, width + own))
    couplings = np.zeros((width + own, tracks.count, 3))
    for view, index in enumerate(camera):
        rows = np.flatnonzero(tracks.view == view)
        columns = np.r_[6 * view : 6 * view + 6, lens_columns[index] : lens_columns[index] + own - 6]
        jacobian = equations.by_view[rows].reshape(-1, own)
        gradient[columns] += jacobian.T @ equations.residual[rows].ravel()
        information[columns[:, None], columns] += jacobian.T @ jacobian
        couplings[columns[:, None], tracks.point[rows]] += np.swapaxes(coupling[rows], 0, 1)
    whitened = couplings.reshape(-1, 3 * tracks.count)[:width]
    whitened_gradient = (root @ gradient_of_points[..., None]).ravel()
    return gradient[:width] - whitened @ whitened_gradient, information[:width, :width] - whitened @ whitened.T


def point_steps(tracks: Tracks, equations: PixelEquations) -> Array:
    """Gauss-Newton steps of the points for fixed cameras, (p, 3) [m]."""
    information, gradient = _point_blocks(tracks, equations)
    return np.asarray(-np.linalg.solve(information, gradient[..., None])[..., 0])


def point_information(tracks: Tracks, equations: PixelEquations) -> Array:
    """Information matrix of each point for known cameras, (p, 3, 3) [1/m^2]."""
    return _point_blocks(tracks, equations)[0]


def _point_blocks(tracks: Tracks, equations: PixelEquations) -> tuple[Array, Array]:
    """Information (p, 3, 3) and gradient (p, 3) of the points, for known cameras."""
    by_point, sums = equations.by_point, GroupSums(tracks.point, tracks.count)
    information = sums.sum(by_point.mT @ by_point) + _RIDGE * np.eye(3)
    return information, sums.sum((by_point.mT @ equations.residual[..., None])[..., 0])
