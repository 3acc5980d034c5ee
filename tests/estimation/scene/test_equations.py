"""Tests of derivatives of image points, and of the elimination of points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.scene.equations import pixel_equations, point_information, point_steps, reduced_equations
from basecal.estimation.scene.state import column_jacobian, scene_columns, take_step
from scene_points import LENS, made_scene


def test_derivatives_equal_finite_differences():
    """Pixels are differentiated by cameras, lenses and points, through all columns."""
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


def test_reduced_equations_are_the_schur_complement():
    """Reduced equations equal the Schur complement of all unknowns, including points."""
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


def test_point_steps_reach_the_intersection_of_rays():
    """From a centimetre off, with exact cameras, three steps bring points to a micrometre."""
    scene = made_scene(6, noise=0.0)
    state = scene.truth.with_points(scene.truth.points + 0.01)
    weight = 1.0
    for _ in range(3):
        equations = pixel_equations(scene.views, scene.tracks, state, weight)
        state = state.with_points(state.points + point_steps(scene.tracks, equations))
    assert np.abs(state.points - scene.truth.points).max() < 1e-6
    assert np.all(np.linalg.eigvalsh(point_information(scene.tracks, equations)) > 0)


def test_fixed_lenses_have_no_columns():
    """The rest equals a system without their parameters, also for one camera of two."""
    scene = made_scene(5, arms=2, count=3, points=15)
    of = pixel_equations(scene.views, scene.tracks, scene.truth, 1.0)
    views, terms = 6 * len(scene.views), len(LENS.parameters)
    whole = reduced_equations(scene.views.camera, scene.tracks, of, [terms, terms])
    for widths in ([0, 0], [terms, 0], [0, terms]):
        kept = np.r_[0:views, views : views + widths[0], views + terms : views + terms + widths[1]]
        gradient, information = reduced_equations(scene.views.camera, scene.tracks, of, widths)
        np.testing.assert_allclose(gradient, whole[0][kept], rtol=1e-9, atol=1e-9 * np.abs(whole[0]).max())
        np.testing.assert_allclose(
            information, whole[1][np.ix_(kept, kept)], rtol=1e-9, atol=1e-9 * np.abs(whole[1]).max()
        )


def test_weights_scale_equations():
    """A weight of two doubles residuals and derivatives, and quadruples the information of points."""
    scene = made_scene(5, count=4, points=15)
    one, two = (pixel_equations(scene.views, scene.tracks, scene.truth, weight) for weight in (1.0, 2.0))
    for name in ("residual", "by_view", "by_point"):
        np.testing.assert_allclose(getattr(two, name), 2 * getattr(one, name))
    halved = two.scale(np.full((len(scene.tracks), 1), 0.5))
    np.testing.assert_allclose(halved.residual, one.residual)
    np.testing.assert_allclose(halved.by_view, one.by_view)
    ratio = point_information(scene.tracks, two) / point_information(scene.tracks, one)
    np.testing.assert_allclose(ratio[:, [0, 1, 2], [0, 1, 2]], 4.0, rtol=1e-6)


def test_points_behind_or_beside_the_camera_have_no_equation():
    """The points are in the plane of the camera, behind it, and at the camera itself."""
    scene = made_scene(5, count=4, points=15)
    camera = scene.truth.world_from_camera(scene.views)[0]
    for place in ([0.1, 0.1, 0.0], [0.1, 0.1, -0.5], [0.0, 0.0, 0.0]):
        points = scene.truth.points.copy()
        index = int(scene.tracks.point[scene.tracks.view == 0][0])
        points[index] = camera @ np.array(place)
        of = pixel_equations(scene.views, scene.tracks, scene.truth.with_points(points), 1.0)
        here = (scene.tracks.view == 0) & (scene.tracks.point == index)
        assert not of.seen[here].any()
        for values in (of.residual, of.by_view, of.by_point):
            assert not values[here].any()


def test_points_behind_a_camera_are_not_seen():
    """Points behind a camera, and non-finite pixels, have no equations, and those of other points are unchanged."""
    scene = made_scene(4, count=4, points=20)
    whole = pixel_equations(scene.views, scene.tracks, scene.truth, 2.0)
    assert whole.seen.all()
    pixels = scene.tracks.pixels.copy()
    pixels[3, 0] = np.nan
    lost = pixel_equations(scene.views, replace(scene.tracks, pixels=pixels), scene.truth, 2.0)
    points = scene.truth.points.copy()
    world_from_camera = scene.truth.world_from_camera(scene.views)[scene.tracks.view[5]]
    points[scene.tracks.point[5]] = world_from_camera @ np.array([0.0, 0.0, -1.0])
    behind = pixel_equations(scene.views, scene.tracks, replace(scene.truth, points=points), 2.0)
    assert not behind.seen[5]
    assert np.flatnonzero(~lost.seen).tolist() == [3]
    for found in (lost, behind):
        assert 0 < np.count_nonzero(found.seen) < len(scene.tracks)
        for part in ("residual", "by_view", "by_point"):
            values = getattr(found, part)
            assert not values[~found.seen].any()
            assert np.isfinite(values).all()
    np.testing.assert_array_equal(lost.by_view[lost.seen], whole.by_view[lost.seen])
