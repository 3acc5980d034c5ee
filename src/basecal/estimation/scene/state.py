"""State of a scene's unknowns, and their columns in a step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.least_squares.normal_equations import retract_lens
from basecal.estimation.scene.views import SceneViews
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.batch import concatenate


@dataclass(frozen=True, eq=False)
class SceneState:
    """Values of all unknowns.

    Attributes:
        mounts: (c,) `flange_from_camera` of each camera, or `world_from_camera` on `world`.
        bases: (r,) `world_from_base` of each robot.
        lenses: Lens of each camera.
        errors: (s, 6) pose error of each stop, right tangents of the flange [m, rad].
        points: (p, 3) scene points in `world` [m].
    """

    mounts: SE3
    bases: SE3
    lenses: tuple[Camera, ...]
    errors: Array
    points: Array

    def with_points(self, points: Array) -> SceneState:
        """Return a copy with other points."""
        return replace(self, points=points)

    def with_camera(self, world_from_camera: SE3, lens: Camera) -> SceneState:
        """Return a copy with an additional camera on `world`."""
        mounts = concatenate([self.mounts, SE3.stack([world_from_camera])])
        return replace(self, mounts=mounts, lenses=(*self.lenses, lens))

    def world_from_camera(self, views: SceneViews) -> SE3:
        """Poses of the cameras of all views, (v,)."""
        return self.world_from_flange(views) @ self.mounts[views.camera]

    def world_from_flange(self, views: SceneViews) -> SE3:
        """Poses of the flanges of all views, including stop errors, (v,); identity on `world`."""
        none = np.zeros(6)  # at index -1, which means `world`
        return self.base_of_views(views) @ views.base_from_flange @ SE3.exp(np.vstack([self.errors, none])[views.stop])

    def base_of_views(self, views: SceneViews) -> SE3:
        """`world_from_base` of the robots of all views, (v,); identity on `world`."""
        return concatenate([self.bases, SE3.identity((1,))])[views.robot]


def start_state(views: SceneViews, mounts: list[SE3], bases: list[SE3], lenses: tuple[Camera, ...]) -> SceneState:
    """Make a state without points and with zero stop errors."""
    errors, points = np.zeros((len(views.stop_robot), 6)), np.zeros((0, 3))
    return SceneState(SE3.stack(mounts), SE3.stack(bases), lenses, errors, points)


@dataclass(frozen=True, eq=False)
class Columns:
    """Slices of the unknowns in a step; None for fixed unknowns.

    Attributes:
        mounts: Slice of each camera's mount.
        bases: Slice of each robot's base.
        lenses: Slice of each camera's lens.
        errors: Slice of all stop errors, the last columns.
    """

    mounts: tuple[slice | None, ...]
    bases: tuple[slice | None, ...]
    lenses: tuple[slice | None, ...]
    errors: slice

    @property
    def lens_widths(self) -> list[int]:
        """Number of columns of each lens; 0 if it is fixed."""
        return [0 if part is None else part.stop - part.start for part in self.lenses]


def scene_columns(views: SceneViews, lenses: tuple[Camera, ...]) -> Columns:
    """Assign columns to all unknowns that are not fixed."""
    end = 0

    def next_columns(width: int) -> slice:
        """Allocate the next `width` columns."""
        nonlocal end
        end += width
        return slice(end - width, end)

    mounts = tuple(None if c.mount.status == "fixed" else next_columns(6) for c in views.cameras)
    bases = tuple(None if base.status == "fixed" else next_columns(6) for base in views.bases)
    widths = [
        0 if c.lens.status == "fixed" else len(lens.parameters) for c, lens in zip(views.cameras, lenses, strict=True)
    ]
    lens_columns = tuple(next_columns(width) if width else None for width in widths)
    return Columns(mounts, bases, lens_columns, next_columns(6 * len(views.stop_robot)))


def column_jacobian(views: SceneViews, state: SceneState, columns: Columns) -> Array:
    """Jacobian of right tangents of all cameras, then of all lens parameters, with respect to the columns.

    Args:
        views: The views.
        state: The state.
        columns: Columns of the unknowns.

    Returns:
        (6 v + k, width) for v views and k lens parameters.
    """
    count, terms = len(views), sum(columns.lens_widths)
    moves = np.zeros((6 * count + terms, columns.errors.stop))
    moves[6 * count :, columns.errors.start - terms : columns.errors.start] = np.eye(terms)
    world_from_flange = state.world_from_flange(views)
    camera_from_flange = state.mounts[views.camera].inverse()
    by_flange = camera_from_flange.adjoint()
    by_base = (world_from_flange.inverse() @ state.base_of_views(views)).adjoint()
    for view in range(count):
        rows = slice(6 * view, 6 * view + 6)
        mount = columns.mounts[views.camera[view]]
        if mount is not None:
            moves[rows, mount] = np.eye(6)
        if views.robot[view] >= 0:
            first = columns.errors.start + 6 * views.stop[view]
            moves[rows, first : first + 6] = by_flange[view]
            base = columns.bases[views.robot[view]]
            if base is not None:
                moves[rows, base] = by_flange[view] @ by_base[view]
    return moves


def take_step(state: SceneState, columns: Columns, step: Array) -> SceneState:
    """Return the state after a step, with unchanged points."""

    def move(transforms: SE3, slices: tuple[slice | None, ...]) -> SE3:
        """Apply the step to transforms."""
        tangents = np.array([np.zeros(6) if part is None else step[part] for part in slices]).reshape(-1, 6)
        return transforms @ SE3.exp(tangents)

    lenses = tuple(
        lens if part is None else retract_lens(lens, step[part])
        for lens, part in zip(state.lenses, columns.lenses, strict=True)
    )
    errors = state.errors + step[columns.errors].reshape(-1, 6)
    return SceneState(
        move(state.mounts, columns.mounts), move(state.bases, columns.bases), lenses, errors, state.points
    )
