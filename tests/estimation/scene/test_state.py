"""Where cameras are by a state, and its unknowns in a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.state import scene_columns, take_step
from basecal.geometry import SE3
from scene_points import BASE, LENS, MOUNT, made_scene


def test_cameras_are_at_base_flange_error_and_mount():
    """`world_from_camera` is the product of the four."""
    scene = made_scene(1, arms=2)
    errors = scene.truth.errors.copy()
    errors[20] = 1e-3
    state = replace(scene.truth, errors=errors)
    expected = BASE @ scene.views.base_from_flange[20] @ SE3.exp(errors[20]) @ MOUNT
    assert np.linalg.norm((expected.inverse() @ state.world_from_camera(scene.views)[20]).log()) < 1e-12


def test_what_is_fixed_has_no_columns():
    """The reference's base, a fixed mount and an exact lens have none; errors of stops come last."""
    views = made_scene(2, arms=2).views
    fixed = replace(views.cameras[0], mount=Unknown("fixed", MOUNT), lens=Intrinsics("fixed", LENS, exact=True))
    columns = scene_columns(replace(views, cameras=(fixed, views.cameras[1])), (LENS, LENS))
    assert columns.mounts == (None, slice(0, 6))
    assert columns.bases == (None, slice(6, 12))
    assert columns.lenses == (None, slice(12, 21))
    assert columns.errors == slice(21, columns.errors.stop)
    assert columns.errors.stop == 21 + 6 * len(views.stop_robot)


def test_a_step_moves_each_unknown_by_its_part():
    """Mounts and bases by right tangents, lenses and errors by sums."""
    scene = made_scene(3, arms=2)
    columns = scene_columns(scene.views, scene.truth.lenses)
    step = np.random.default_rng(0).normal(0, 1e-3, columns.errors.stop)
    after = take_step(scene.truth, columns, step)
    assert np.linalg.norm((BASE.inverse() @ after.bases[1]).log() - step[columns.bases[1]]) < 1e-12
    assert np.linalg.norm((MOUNT.inverse() @ after.mounts[0]).log() - step[columns.mounts[0]]) < 1e-12
    assert np.abs(after.lenses[1].parameters - LENS.parameters - step[columns.lenses[1]]).max() < 1e-12
    assert np.abs(after.errors.ravel() - step[columns.errors]).max() == 0
