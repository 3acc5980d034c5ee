"""Add the tracks of a scene to a problem: linearised about a state, with the scene points eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.tied_views import TiedViews
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.equations import equations_of_points, point_steps, reduced_equations
from basecal.numerics.batch import concatenate

_POINT_STEPS = 3  # Gauss-Newton steps to optimise the points; evaluated by `benchmarks.scene`


def with_scene(problem: Problem, state: State, groups: Sequence[ViewGroup], fit: SceneFit, sigma_px: float) -> Problem:
    """Return a problem with the tracks of a scene, linearised about a state.

    Args:
        problem: Problem without the scene.
        state: Values of all unknowns and lenses, including lenses of cameras that only see the scene.
        groups: Views of the scene, one group per camera in the order of `fit`.
        fit: Tracks, and initial points.
        sigma_px: Sigma of image points [px].
    """
    lenses = {camera.name: camera.lens for camera in fit.views.cameras}
    columns, width = dict(problem.columns), problem.width
    for name, lens in lenses.items():
        if name not in columns and lens.status != "fixed":
            count = len(state.cameras[name].parameters)
            columns[name], width = slice(width, width + count), width + count
    extended = replace(problem, lenses={**lenses, **problem.lenses}, columns=columns)
    return replace(extended, tied=_eliminate_points(extended, state, groups, fit, sigma_px))


def _eliminate_points(
    problem: Problem, state: State, groups: Sequence[ViewGroup], fit: SceneFit, sigma_px: float
) -> TiedViews:
    order = np.concatenate([np.flatnonzero(fit.views.camera == k) for k in range(len(groups))])
    tracks = replace(fit.tracks, view=np.argsort(order)[fit.tracks.view])
    camera = fit.views.camera[order]
    camera_from_world = concatenate([state.camera_from_target(group, problem.stops) for group in groups])
    lenses = tuple(state.cameras[group.camera] for group in groups)
    points = fit.state.points
    for _ in range(_POINT_STEPS):
        equations = equations_of_points(tracks, camera, camera_from_world, lenses, points, 1 / sigma_px)
        points = points + point_steps(tracks, equations)
    equations = equations_of_points(tracks, camera, camera_from_world, lenses, points, 1 / sigma_px)
    free = {group.camera: lens for group, lens in zip(groups, lenses, strict=True) if group.camera in problem.columns}
    widths = [len(lens.parameters) if group.camera in free else 0 for group, lens in zip(groups, lenses, strict=True)]
    gradient, information = reduced_equations(camera, tracks, equations, widths)
    # Right tangents of `world_from_camera` to those of `camera_from_world`: minus the adjoint.
    tangent_map = block_diag(*-camera_from_world.adjoint(), np.eye(sum(widths)))
    return TiedViews(
        tuple(groups),
        camera_from_world,
        free,
        float(np.sum(equations.residual**2)),
        tangent_map.T @ gradient,
        tangent_map.T @ information @ tangent_map,
        2 * len(tracks) - 3 * tracks.count,
        points,
    )
