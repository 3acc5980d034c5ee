"""Tests of the world of two arms that face each other."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.registry import TARGETS
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.two_arms import (
    _REACHED_POSE,
    _camera_from_target,
    _draw_pose,
    _home_joints,
    _plate_mount,
    _stated_unknown,
    two_arms,
)
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.scene import front
from basecal.vision.detectors import find_target


@pytest.mark.parametrize("seed", range(3))
def test_target_is_fully_visible_at_home(seed):
    """Every corner of the board is found in the first image.

    The stated transforms are near the true ones, but not equal.
    """
    world = two_arms("charuco", seed)
    board = world.cell.targets["board"].target
    found = find_target(Plant(world, Clock(0)).shot("wrist").image, board)
    assert len(found.pixels) == len(board.points)
    for name, unknown in world.cell.transforms.items():
        off = (world.truth[name].inverse() @ unknown.mean).log()
        assert 1e-3 < np.linalg.norm(off[:3]) < 0.1
        assert unknown.status == "free"
    facing = SE3.from_rotvec([0, 0, np.pi], [1.7, 0, 0])
    off = (facing.inverse() @ world.truth["eye_base_from_hand_base"]).log()
    assert 1e-3 < np.linalg.norm(off[:3]) < 0.15
    assert 1e-3 < np.linalg.norm(off[3:]) < 0.4


def test_led_cell_has_fixed_mounts():
    """As in the paper, the mounts of a cell with an LED are fixed, and the base is free."""
    cell = two_arms("led", 1).cell
    assert {name: unknown.status for name, unknown in cell.transforms.items()} == {
        "eye_base_from_hand_base": "free",
        "eye_flange_from_wrist": "fixed",
        "hand_flange_from_light": "fixed",
    }


SHAPES = {kind: TARGETS[kind].usual(np.random.default_rng(0)) for kind in ("charuco", "apriltag", "points", "led")}


@pytest.mark.parametrize("kind", SHAPES)
def test_targets_are_upright_on_optical_axis(kind):
    """The centre of the target is 0.65 m away at home. A board shows its front, x to the right and y down."""
    shape = SHAPES[kind]
    seen = _camera_from_target(shape)
    np.testing.assert_allclose(seen @ shape.points.mean(0), [0, 0, 0.65], atol=1e-12)
    if shape.is_point:
        np.testing.assert_allclose(seen.rotation, np.diag([-1.0, 1.0, -1.0]))
    else:
        np.testing.assert_allclose(seen.rotation @ front(shape), np.eye(3), atol=1e-12)


@pytest.mark.parametrize("kind", SHAPES)
def test_plates_face_away_from_the_flange(kind):
    """Their centre is 60 mm ahead of the flange, within 20 mm.

    A board is tilted by at most 0.06 rad, a point not at all.
    """
    shape, offs, tilts = SHAPES[kind], [], []
    rng = np.random.default_rng(0)
    for _ in range(50):
        plate = _plate_mount(shape, rng)
        offs.append(np.linalg.norm(plate @ shape.points.mean(0) - [0, 0, 0.06]))
        facing = np.diag([1.0, -1.0, -1.0]) if not shape.is_point else np.eye(3)
        turned = plate.rotation if shape.is_point else plate.rotation @ front(shape)
        tilts.append(np.linalg.norm(SE3(facing.T @ turned, np.zeros(3)).rotvec))
    assert 0.015 < max(offs) <= 0.02
    assert max(tilts) <= 0.0601
    assert (max(tilts) > 0.04) == (not shape.is_point)


def test_drawn_poses_have_stated_sigmas():
    """The sigma of translation comes first."""
    rng = np.random.default_rng(0)
    drawn = np.array([_draw_pose(rng, (0.03, 0.08)).log() for _ in range(150)])
    np.testing.assert_allclose(drawn.std(0), [0.03] * 3 + [0.08] * 3, rtol=0.2)


def test_stated_transforms_are_guesses_or_exact():
    """A guess has errors of 20 mm and 50 mrad. The mounts of a cell with an LED are exact, its base is not."""
    rng, true = np.random.default_rng(0), SE3.from_rpy((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    guesses = [_stated_unknown("eye_flange_from_wrist", true, rng, False) for _ in range(150)]
    off = np.array([(true.inverse() @ guess.mean).log() for guess in guesses])
    np.testing.assert_allclose(off.std(0), [0.02] * 3 + [0.05] * 3, rtol=0.2)
    assert {guess.status for guess in guesses} == {"free"}
    known = _stated_unknown("eye_flange_from_wrist", true, rng, True)
    assert (known.status, known.mean) == ("fixed", true)
    assert _stated_unknown("eye_base_from_hand_base", true, rng, True).status == "free"


def test_arms_reach_their_home_within_half_a_turn():
    """The home is far from singular postures; a pose out of reach is refused."""
    chain = ur5e()
    joints = _home_joints(chain, _REACHED_POSE)
    np.testing.assert_allclose(chain.forward(joints).matrix, _REACHED_POSE.matrix, atol=1e-8)
    assert np.abs(joints).max() < np.pi
    assert abs(np.linalg.det(chain.jacobian(joints))) > 0.03
    with pytest.raises(InputError, match="choose another seed"):
        _home_joints(chain, SE3(_REACHED_POSE.rotation, np.array([2.0, 0.0, 0.5])))
