"""Tests of the sketch of a cell: its known or guessed transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, CellTarget, Robot, RobotState, Sample, Unknown
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning.sketch import Sketch, hand_guided_sketch, possible_views, sketch_cell, target_points
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()


def with_truth(cell):
    """Cell with all transforms fixed at their true values."""
    known = {name: Unknown("fixed", true) for name, true in WORLD.truth.items()}
    camera, board = cell.cameras["wrist"], cell.targets["board"]
    return replace(
        cell,
        bases={"hand": known["eye_base_from_hand_base"]},
        cameras={"wrist": replace(camera, mount=known["eye_flange_from_wrist"])},
        targets={"board": replace(board, mount=known["hand_flange_from_board"])},
    )


def test_sketch_predicts_the_view():
    """With the true transforms the board is straight in front of the camera at 0.65 m, as the cell was built."""
    seen = sketch_cell(with_truth(WORLD.cell)).camera_from_target(Sample(0, robots=home(WORLD)))
    middle = seen @ WORLD.cell.targets["board"].target.points.mean(0)
    np.testing.assert_allclose(middle, [0, 0, 0.65], atol=1e-9)


def test_sketch_accepts_guesses():
    """With the guesses of the cell the prediction is off by some centimetres. The sketch lists the moving arms."""
    sketch = sketch_cell(WORLD.cell)
    middle = sketch.camera_from_target(Sample(0, robots=home(WORLD))) @ WORLD.cell.targets["board"].target.points.mean(
        0
    )
    assert 1e-3 < np.linalg.norm(middle - [0, 0, 0.65]) < 0.2
    assert (sketch.view, sketch.movers) == (("wrist", "board"), ("eye", "hand"))


def test_missing_parts_are_named():
    """A base without a guess, a missing target and a missing lens are reported with what to write."""
    with pytest.raises(InputError, match=r"give eye_base_from_hand_base a value, or .* `guess:"):
        sketch_cell(replace(WORLD.cell, bases={"hand": Unknown()}))
    with pytest.raises(InputError, match="no camera with a target"):
        sketch_cell(replace(WORLD.cell, targets={}))
    with pytest.raises(InputError, match="five of them of one spot"):
        sketch_cell(replace(WORLD.cell, targets={}, sees_scene=True))
    with pytest.raises(InputError, match="wrist: a plan needs a lens"):
        _ = sketch_cell(
            replace(WORLD.cell, cameras={"wrist": replace(WORLD.cell.cameras["wrist"], intrinsics=None)})
        ).lens


def test_movers_carry_camera_or_target():
    """The carrier of the camera comes first. The movers of a scene are all carriers of cameras."""
    assert sketch_cell(WORLD.cell).movers == ("eye", "hand")
    (wrist,), (board,) = WORLD.cell.cameras.values(), WORLD.cell.targets.values()
    still = replace(
        WORLD.cell, targets={board.name: replace(board, on="world", mount=Unknown("fixed", SE3.identity()))}
    )
    assert sketch_cell(still).movers == ("eye",)
    cameras = {"wrist": wrist, "top": replace(wrist, name="top", on="world"), "other": replace(wrist, name="other")}
    scene = hand_guided_sketch(replace(WORLD.cell, sees_scene=True, cameras=cameras, targets={}))
    assert (scene.movers, scene.view) == (("eye",), ("wrist", ""))


def test_hand_guided_sketch_requires_a_camera():
    """A hand-guided scene requires a camera. A cell with a target has its ordinary sketch."""
    assert hand_guided_sketch(WORLD.cell).view == ("wrist", "board")
    with pytest.raises(InputError, match="the cell has no camera"):
        hand_guided_sketch(replace(WORLD.cell, sees_scene=True, cameras={}, targets={}))


RNG = np.random.default_rng(0)
BASE, ON_EYE, ON_HAND, BESIDE, ON_PLATE, PLATE, EYE, HAND = SE3.exp(RNG.standard_normal((8, 6)))


def make_full_sketch():
    """A cell with cameras on an arm and beside it, and targets on the other arm, on a plate and on the world."""
    cameras = {"wrist": CellCamera("wrist", "eye"), "beside": CellCamera("beside", "world")}
    places = {"board": "hand", "mark": "plate", "still": "world"}
    targets = {name: CellTarget(name, on) for name, on in places.items()}
    robots = {name: Robot(name) for name in ("eye", "hand")}
    cell = Cell("eye", robots, {"hand": Unknown()}, cameras, targets, plates={"plate": Unknown()})
    known = {
        cell.base_name("hand"): BASE,
        cell.mount_name("wrist"): ON_EYE,
        cell.mount_name("beside"): BESIDE,
        cell.mount_name("board"): ON_HAND,
        cell.mount_name("mark"): ON_PLATE,
        cell.mount_name("still"): BESIDE,
        cell.plate_name("plate"): PLATE,
    }
    return Sketch(cell, known, ("wrist", "board"))


def test_body_poses_follow_their_carriers():
    """Poses of bodies are right on either arm, on the world, and on a plate."""
    sketch, states = make_full_sketch(), {"eye": RobotState(EYE), "hand": RobotState(HAND)}
    for name, pose in {
        "wrist": EYE @ ON_EYE,
        "beside": BESIDE,
        "board": BASE @ HAND @ ON_HAND,
        "mark": PLATE @ ON_PLATE,
        "still": BESIDE,
    }.items():
        np.testing.assert_allclose(sketch.body_pose(name, states).matrix, pose.matrix, atol=1e-12)
    seen = sketch.camera_from_target(Sample(0, robots=states))
    wanted = (EYE @ ON_EYE).inverse() @ BASE @ HAND @ ON_HAND
    np.testing.assert_allclose(seen.matrix, wanted.matrix, atol=1e-12)


def test_possible_views_have_different_carriers():
    """Each camera is paired with each target on another carrier.

    The movers of a view are its arms, the camera's first.
    """
    sketch = make_full_sketch()
    assert possible_views(sketch.cell) == [
        ("wrist", "board"), ("wrist", "mark"), ("wrist", "still"), ("beside", "board"), ("beside", "mark"),
    ]  # fmt: skip
    movers = {view: replace(sketch, view=view).movers for view in possible_views(sketch.cell)}
    assert movers["wrist", "board"] == ("eye", "hand")
    assert movers["beside", "board"] == ("hand",)
    assert movers["wrist", "mark"] == ("eye",)
    assert movers["beside", "mark"] == ()


def test_joints_require_kinematics():
    """A robot that is sent to joints without kinematics is named in the error; poses require none."""
    sketch = make_full_sketch()
    assert sketch.base_from_flange("eye", RobotState(EYE)) is EYE
    with pytest.raises(InputError, match="eye: joints need urdf"):
        sketch.base_from_flange("eye", RobotState(joints_rad=np.zeros(6)))


def test_a_target_without_a_shape_is_a_point():
    """The only point of a target without a shape is its origin."""
    np.testing.assert_array_equal(target_points(None), np.zeros((1, 3)))
    board = WORLD.cell.targets["board"].target
    assert target_points(board) is board.points
