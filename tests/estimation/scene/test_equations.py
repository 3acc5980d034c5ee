"""Derivatives of image points, and points eliminated."""

from __future__ import annotations

import numpy as np

from basecal.estimation.scene.equations import pixel_equations, point_information, point_steps, reduced_equations, sums
from basecal.estimation.scene.state import column_jacobian, scene_columns, take_step
from scene_points import LENS, made_scene


def test_derivatives_are_differences():
    """Of pixels by cameras, lenses and points, through all columns."""
    scene = made_scene(4, arms=2, count=4, points=20)
    state = scene.truth
    columns = scene_columns(scene.views, state.lenses)
    weight = 1.0
    of = pixel_equations(scene.views, scene.tracks, state, weight)
    moves = column_jacobian(scene.views, state, columns)
    count = len(scene.views)
    rng = np.random.default_rng(0)
    step = rng.standard_normal(columns.errors.stop) * 1e-7
    tangents = (moves @ step)[: 6 * count].reshape(count, 6)
    lens_steps = (moves @ step)[6 * count :].reshape(2, -1)
    predicted = (of.by_view[..., :6] @ tangents[scene.tracks.view][..., None])[..., 0]
    predicted += (of.by_view[..., 6:] @ lens_steps[scene.views.camera[scene.tracks.view]][..., None])[..., 0]
    after = pixel_equations(scene.views, scene.tracks, take_step(state, columns, step), weight)
    assert np.abs(after.residual - of.residual - predicted).max() < 1e-7


def test_points_are_eliminated_as_by_a_whole_system():
    """The reduced equations are the Schur complement of all unknowns, points among them."""
    scene = made_scene(5, count=4, points=15)
    state = scene.truth
    columns = scene_columns(scene.views, state.lenses)
    of = pixel_equations(scene.views, scene.tracks, state, 1.0)
    gradient_left, left = reduced_equations(scene.views.camera, scene.tracks, of, columns.lens_widths)
    views, points, terms = len(scene.views), scene.tracks.count, len(LENS.parameters)
    whole = np.zeros((2 * len(scene.tracks), 6 * views + terms + 3 * points))
    for row, (view, point) in enumerate(zip(scene.tracks.view, scene.tracks.point, strict=True)):
        rows = slice(2 * row, 2 * row + 2)
        whole[rows, 6 * view : 6 * view + 6] = of.by_view[row, :, :6]
        whole[rows, 6 * views : 6 * views + terms] = of.by_view[row, :, 6:]
        whole[rows, 6 * views + terms + 3 * point : 6 * views + terms + 3 * point + 3] = of.by_point[row]
    information, gradient = whole.T @ whole, whole.T @ of.residual.ravel()
    kept = 6 * views + terms
    gain = information[:kept, kept:] @ np.linalg.inv(information[kept:, kept:])
    scale = np.abs(information[:kept, :kept]).max()
    assert np.abs(left - (information[:kept, :kept] - gain @ information[kept:, :kept])).max() < 1e-6 * scale
    assert np.abs(gradient_left - (gradient[:kept] - gain @ gradient[kept:])).max() < 1e-6 * np.abs(gradient).max()


def test_points_step_to_where_their_rays_meet():
    """From a centimetre off, with exact cameras, two steps bring points to a micrometre."""
    scene = made_scene(6, noise=0.0)
    state = scene.truth.with_points(scene.truth.points + 0.01)
    weight = 1.0
    for _ in range(3):
        equations = pixel_equations(scene.views, scene.tracks, state, weight)
        state = state.with_points(state.points + point_steps(scene.tracks, equations))
    assert np.abs(state.points - scene.truth.points).max() < 1e-6
    assert np.all(np.linalg.eigvalsh(point_information(scene.tracks, equations)) > 0)


def test_sums_go_by_index():
    """Values of one index are added, absent ones are zero."""
    assert sums(np.array([0, 2, 0]), 4, np.array([[1.0], [2.0], [3.0]])).ravel().tolist() == [4.0, 0.0, 2.0, 0.0]
