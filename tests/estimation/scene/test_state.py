"""Tests of camera poses of a state, and of steps of its unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.state import column_jacobian, scene_columns, start_state, take_step
from basecal.geometry import SE3
from basecal.numerics.batch import concatenate
from scene_points import BASE, LENS, MOUNT, made_scene


def test_camera_pose_is_base_flange_error_and_mount():
    """`world_from_camera` is the product of the four."""
    scene = made_scene(1, arms=2)
    errors = scene.truth.errors.copy()
    errors[20] = 1e-3
    state = replace(scene.truth, errors=errors)
    expected = BASE @ scene.views.base_from_flange[20] @ SE3.exp(errors[20]) @ MOUNT
    assert np.linalg.norm((expected.inverse() @ state.world_from_camera(scene.views)[20]).log()) < 1e-12


def test_fixed_transforms_have_no_columns():
    """The reference's base, a fixed mount and an exact lens have none. Stop errors come last."""
    views = made_scene(2, arms=2).views
    fixed = replace(views.cameras[0], mount=Unknown("fixed", MOUNT), lens=Intrinsics("fixed", LENS, exact=True))
    columns = scene_columns(replace(views, cameras=(fixed, views.cameras[1])), (LENS, LENS))
    assert columns.mounts == (None, slice(0, 6))
    assert columns.bases == (None, slice(6, 12))
    assert columns.lenses == (None, slice(12, 21))
    assert columns.errors == slice(21, columns.errors.stop)
    assert columns.errors.stop == 21 + 6 * len(views.stop_robot)


def test_step_moves_each_unknown_by_its_part():
    """Mounts and bases move by right tangents, lenses and errors by sums."""
    scene = made_scene(3, arms=2)
    columns = scene_columns(scene.views, scene.truth.lenses)
    step = np.random.default_rng(0).normal(0, 1e-3, columns.errors.stop)
    after = take_step(scene.truth, columns, step)
    assert np.linalg.norm((BASE.inverse() @ after.bases[1]).log() - step[columns.bases[1]]) < 1e-12
    assert np.linalg.norm((MOUNT.inverse() @ after.mounts[0]).log() - step[columns.mounts[0]]) < 1e-12
    assert np.abs(after.lenses[1].parameters - LENS.parameters - step[columns.lenses[1]]).max() < 1e-12
    assert np.abs(after.errors.ravel() - step[columns.errors]).max() == 0


def with_world_camera(seed=3):
    """Two arms with a camera each, and a world camera in place of the second arm's first stops."""
    scene = made_scene(seed, arms=2, count=3)
    state = scene.truth.with_camera(SE3.exp([0.1, 0.2, 0.9, 0.1, 3.0, 0.2]), LENS)
    views = scene.views
    hall = replace(views.cameras[0], name="hall", robot=None)
    more = replace(
        views,
        cameras=(*views.cameras, hall),
        sample=np.r_[views.sample, 0, 1],
        camera=np.r_[views.camera, 2, 2],
        robot=np.r_[views.robot, -1, -1],
        stop=np.r_[views.stop, -1, -1],
        base_from_flange=concatenate([views.base_from_flange, SE3.identity((2,))]),
    )
    return more, replace(state, errors=np.full((6, 6), 1e-3))


def test_camera_on_the_world_is_at_its_mount():
    """No base and no stop error moves it, and poses of the views before it are unchanged."""
    views, state = with_world_camera()
    poses = state.world_from_camera(views)
    for k in (6, 7):
        np.testing.assert_allclose(poses[k].matrix, state.mounts[2].matrix, atol=1e-15)
    expected = BASE @ views.base_from_flange[5] @ SE3.exp(np.full(6, 1e-3)) @ MOUNT
    np.testing.assert_allclose(poses[5].matrix, expected.matrix, atol=1e-12)
    assert len(state.lenses) == 3


def test_column_jacobian_equals_pose_differences():
    """A step of all unknowns moves cameras on arms and on the world as the Jacobian predicts."""
    views, state = with_world_camera()
    state = replace(state, errors=np.zeros((6, 6)))
    columns = scene_columns(views, state.lenses)
    moves = column_jacobian(views, state, columns)
    assert moves.shape == (6 * 8 + 27, columns.errors.stop)
    before = state.world_from_camera(views)
    rng = np.random.default_rng(1)
    step = 1e-6 * rng.standard_normal(columns.errors.stop)
    after = take_step(state, columns, step).world_from_camera(views)
    np.testing.assert_allclose((moves @ step)[:48], (before.inverse() @ after).log().ravel(), atol=1e-10)
    lenses = np.concatenate([step[where] for where in columns.lenses])
    np.testing.assert_allclose((moves @ step)[48:], lenses)
    assert columns.lens_widths == [9, 9, 9]


def test_start_state_has_no_errors_and_points():
    """A start state has one zero error for each stop, whatever the number of views, and no points."""
    views, state = with_world_camera()
    start = start_state(views, list(state.mounts), list(state.bases), state.lenses)
    assert start.errors.tolist() == [[0.0] * 6] * 6
    assert start.points.shape == (0, 3)
    np.testing.assert_array_equal(start.mounts.matrix, state.mounts.matrix)
