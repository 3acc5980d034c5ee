"""A value for all that views of a scene depend on, and the columns of these unknowns in a step."""

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
        mounts: (c,) `flange_from_camera` by camera, `world_from_camera` on `world`.
        bases: (r,) `world_from_base` by robot.
        lenses: By camera.
        errors: (s, 6) pose error of each stop, right tangents of the flange [m, rad].
        points: (p, 3) of the scene in `world` [m].
    """

    mounts: SE3
    bases: SE3
    lenses: tuple[Camera, ...]
    errors: Array
    points: Array

    def with_points(self, points: Array) -> SceneState:
        """A copy with other points."""
        return replace(self, points=points)

    def with_camera(self, world_from_camera: SE3, lens: Camera) -> SceneState:
        """A copy with one camera more, on `world`."""
        mounts = concatenate([self.mounts, SE3.stack([world_from_camera])])
        return replace(self, mounts=mounts, lenses=(*self.lenses, lens))

    def world_from_camera(self, views: SceneViews) -> SE3:
        """Where the cameras of all views were, (v,)."""
        return self.world_from_flange(views) @ self.mounts[views.camera]

    def world_from_flange(self, views: SceneViews) -> SE3:
        """Where the flanges of all views were, (v,); identity on `world`."""
        none = np.zeros(6)  # at -1, which stands for `world`
        return self.base_of_views(views) @ views.base_from_flange @ SE3.exp(np.vstack([self.errors, none])[views.stop])

    def base_of_views(self, views: SceneViews) -> SE3:
        """`world_from_base` of the robots of all views, (v,); identity on `world`."""
        return concatenate([self.bases, SE3.identity((1,))])[views.robot]


def start_state(views: SceneViews, mounts: list[SE3], bases: list[SE3], lenses: tuple[Camera, ...]) -> SceneState:
    """A state without points, and without errors of stops."""
    errors, points = np.zeros((len(views.stop_robot), 6)), np.zeros((0, 3))
    return SceneState(SE3.stack(mounts), SE3.stack(bases), lenses, errors, points)


@dataclass(frozen=True, eq=False)
class Columns:
    """Where unknowns stand in a step; None for what is fixed.

    Attributes:
        mounts: By camera.
        bases: By robot.
        lenses: By camera.
        errors: Of all stops, the last.
    """

    mounts: tuple[slice | None, ...]
    bases: tuple[slice | None, ...]
    lenses: tuple[slice | None, ...]
    errors: slice

    @property
    def lens_widths(self) -> list[int]:
        """How many columns each lens has."""
        return [0 if where is None else where.stop - where.start for where in self.lenses]


def scene_columns(views: SceneViews, lenses: tuple[Camera, ...]) -> Columns:
    """The columns of all that is not fixed."""
    at = 0

    def next_columns(width: int) -> slice:
        """The next columns, so many."""
        nonlocal at
        at += width
        return slice(at - width, at)

    mounts = tuple(None if c.mount.status == "fixed" else next_columns(6) for c in views.cameras)
    bases = tuple(None if base.status == "fixed" else next_columns(6) for base in views.bases)
    widths = [
        0 if c.lens.status == "fixed" else len(lens.parameters) for c, lens in zip(views.cameras, lenses, strict=True)
    ]
    of_lenses = tuple(next_columns(width) if width else None for width in widths)
    return Columns(mounts, bases, of_lenses, next_columns(6 * len(views.stop_robot)))


def column_jacobian(views: SceneViews, state: SceneState, columns: Columns) -> Array:
    """How right tangents of all cameras, then parameters of all lenses, move with the columns, (6 v + k, width).

    Args:
        views: The views.
        state: The state.
        columns: Of the unknowns.
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
            at = columns.errors.start + 6 * views.stop[view]
            moves[rows, at : at + 6] = by_flange[view]
            base = columns.bases[views.robot[view]]
            if base is not None:
                moves[rows, base] = by_flange[view] @ by_base[view]
    return moves


def take_step(state: SceneState, columns: Columns, step: Array) -> SceneState:
    """The state after a step, with the points as they were."""

    def move(transforms: SE3, places: tuple[slice | None, ...]) -> SE3:
        """Transforms after their parts of the step."""
        tangents = np.array([np.zeros(6) if where is None else step[where] for where in places]).reshape(-1, 6)
        return transforms @ SE3.exp(tangents)

    lenses = tuple(
        lens if where is None else retract_lens(lens, step[where])
        for lens, where in zip(state.lenses, columns.lenses, strict=True)
    )
    errors = state.errors + step[columns.errors].reshape(-1, 6)
    return SceneState(
        move(state.mounts, columns.mounts), move(state.bases, columns.bases), lenses, errors, state.points
    )
