"""Tests of the distributions of random draws of the simulation."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.geometry.lenses.registry import lens_models
from basecal.simulation import draw
from basecal.simulation.scenario import Scenario


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_draws_in_ball_are_uniform(rng):
    """Half the radius contains an eighth of 8,000 vectors (sigma 0.4 %).

    None is outside, and their mean is the centre.
    """
    vectors = draw.draw_in_ball(rng, 8000, 2.0)
    length = np.linalg.norm(vectors, axis=1)
    assert length.max() <= 2.0
    assert np.mean(length < 1.0) == pytest.approx(1 / 8, abs=0.015)
    np.testing.assert_allclose(vectors.mean(0), 0, atol=0.04)


def test_rotations_are_uniform(rng):
    """Columns have no preferred direction, and the angle has the mean of uniform rotations, 126.5 deg (sigma 0.8)."""
    matrices = draw.rotations(rng, 2000)
    np.testing.assert_allclose(np.linalg.det(matrices), 1)
    np.testing.assert_allclose(matrices.mean(0), 0, atol=0.06)
    angle = np.degrees(np.arccos(np.clip((np.trace(matrices, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert angle.mean() == pytest.approx(126.5, abs=3)


def test_tangents_have_stated_sigmas(rng):
    """Translations have the first sigma and rotations the second, within 4 % for 4,000 draws."""
    np.testing.assert_allclose(draw.tangents(rng, 4000, (1e-3, 0.2)).std(0), [1e-3] * 3 + [0.2] * 3, rtol=0.04)


def test_mount_of_point_has_no_rotation(rng):
    """Both mounts are within a decimetre; only that of a board is rotated."""
    point, board = draw.mount(rng, True), draw.mount(rng, False)
    np.testing.assert_array_equal(point.rotation, np.eye(3))
    assert np.linalg.norm(board.rotvec) > 0.1
    assert max(np.linalg.norm(each.translation) for each in (point, board)) <= 0.1


@pytest.mark.parametrize("model", lens_models())
def test_lens_has_requested_model(rng, model):
    """The lens is of the requested model.

    Its centre is within 15 px of the image centre, and its focal lengths differ by at most half a percent.
    """
    for _ in range(20):
        lens = draw.lens(rng, Scenario(lens=model))
        fx, fy, cx, cy = lens.parameters[:4]
        assert lens.model == model
        assert lens.size_px == (1280, 720)
        assert abs(fy / fx - 1) <= 0.005
        assert abs(cx - 639.5) <= 15
        assert abs(cy - 359.5) <= 15


def test_stated_lens_and_board_are_not_drawn(rng):
    """The lens and the board of the scenario are used unchanged and leave the random generator untouched."""
    lens, board = draw.lens(rng, Scenario()), led_target()
    before = rng.bit_generator.state
    assert draw.lens(rng, Scenario(camera=lens)) is lens
    assert draw.shape(rng, Scenario(board=board)) is board
    assert rng.bit_generator.state == before


@pytest.mark.parametrize(("seen", "kind"), [("pose", "charuco"), ("points3d", "points"), ("led", "led")])
def test_target_shape_matches_observed_kind(rng, seen, kind):
    """Poses are those of a board, 3-D points those of points, and every other kind is itself."""
    assert draw.shape(rng, Scenario(target=seen)).kind == kind
