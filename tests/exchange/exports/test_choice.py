"""Tests of the choice of exported transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, Robot, Unknown
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.choice import both_directions, chosen_transforms, frame_names
from basecal.geometry import PoseEstimate
from export_example import BASE, CALIBRATION, CELL, FIXED, INVERSE, MOUNT, POINT


def names(transforms):
    return [one.name for one in transforms]


def test_default_transforms_are_bases():
    """The cell's bases are chosen; without the cell the estimated ones; without a base all estimated transforms."""
    assert names(chosen_transforms(CALIBRATION, CELL)) == names(chosen_transforms(CALIBRATION)) == [BASE]
    without = {name: each for name, each in CALIBRATION.transforms.items() if name != BASE}
    assert names(chosen_transforms(replace(CALIBRATION, transforms=without))) == [MOUNT]


def test_transform_is_chosen_in_either_direction():
    """The inverse of a key is found too, with the covariance of the inverse."""
    (forth,), (back,) = chosen_transforms(CALIBRATION, CELL, BASE), chosen_transforms(CALIBRATION, CELL, INVERSE)
    np.testing.assert_allclose((forth.estimate.mean @ back.estimate.mean).matrix, np.eye(4), atol=1e-14)
    np.testing.assert_allclose(back.estimate.covariance, forth.estimate.inverse().covariance)
    assert (back.name, back.parent, back.child) == (INVERSE, forth.child, forth.parent)


def test_transform_between_any_frames_is_chosen():
    """Two non-reference robots of three are chosen, with names of the other program.

    An exactly known transform is fixed.
    """
    third = "eye_base_from_third_base"
    placed = {**CALIBRATION.transforms, third: PoseEstimate.exact(CALIBRATION[BASE].mean.inverse())}
    found = replace(CALIBRATION, transforms=placed, order=(BASE,), joint_covariance=CALIBRATION[BASE].covariance)
    (one,) = chosen_transforms(found, CELL, "third_base_from_hand_base")
    mean = CALIBRATION[BASE].mean
    np.testing.assert_allclose(one.estimate.mean.matrix, (mean @ mean).matrix, atol=1e-12)
    np.testing.assert_allclose(one.estimate.covariance, CALIBRATION[BASE].covariance)
    assert (one.parent, one.child, one.status) == ("third_base", "right_base", "free")
    exact = replace(found, order=(), joint_covariance=None)
    assert chosen_transforms(exact, CELL, "third_base_from_hand_base")[0].status == "fixed"


def test_colliding_frame_names_use_cell_names():
    """Two bases called base_link would be one frame of tf at two places; exported alone each keeps its name."""
    third = "eye_base_from_third_base"
    found = replace(CALIBRATION, transforms={**CALIBRATION.transforms, third: CALIBRATION[BASE]})
    robots = {**CELL.robots, "third": Robot("third", frames={"base": "right_base"})}
    cell = replace(CELL, robots=robots, bases={**CELL.bases, "third": Unknown()})
    chosen = chosen_transforms(found, cell)
    assert [(one.name, one.parent, one.child) for one in chosen] == [
        (BASE, "left base's", "hand_base"),
        (third, "left base's", "third_base"),
    ]
    assert chosen_transforms(found, cell, third)[0].child == "right_base"


def test_both_directions_skip_points():
    """Transforms with a rotation are listed in both directions, without points."""
    assert names(both_directions(CALIBRATION))[:3] == [BASE, INVERSE, MOUNT]
    assert len(both_directions(CALIBRATION)) == 6


def test_impossible_choices_are_refused():
    """Unknown frames or names, a point, frames that move, a repeated frame, and an empty calibration are errors."""
    there = "there are: eye_base, hand_base, eye_flange, wrist, hand_flange, board"
    with pytest.raises(FrameNotFound, match=rf"no 'hand_bas' \(did you mean 'hand_base'\?\); {there}"):
        chosen_transforms(CALIBRATION, CELL, "eye_base_from_hand_bas")
    with pytest.raises(FrameNotFound, match=r"no 'hand_base'.* there are: eye_base_from_hand_base"):
        chosen_transforms(CALIBRATION, CELL, "hand_base")
    with pytest.raises(InputError, match="place of a point"):
        chosen_transforms(CALIBRATION, CELL, POINT)
    with pytest.raises(InputError, match=f"'led' is a point and has no rotation: see {POINT}"):
        chosen_transforms(CALIBRATION, CELL, "board_from_led")
    with pytest.raises(InputError, match=r"'wrist' and 'eye_base' are not rigidly connected.* to 'wrist': eye_flange"):
        chosen_transforms(CALIBRATION, CELL, "wrist_from_eye_base")
    with pytest.raises(InputError, match="eye_base_from_eye_base has one frame twice: name two, such as"):
        chosen_transforms(CALIBRATION, CELL, "eye_base_from_eye_base")
    with pytest.raises(InputError, match="name one of: none"):
        chosen_transforms(Calibration("good"))
    with pytest.raises(InputError, match=f"name one of: {FIXED}"):
        chosen_transforms(replace(CALIBRATION, transforms={FIXED: CALIBRATION[FIXED]}))


def test_equal_frame_names_fall_back_to_own():
    """Two robots with the same URDF have links of the same name."""
    same = {name: Robot(name, frames={"base": "base_link"}) for name in ("eye", "hand")}
    assert frame_names(replace(CELL, robots=same), BASE) == ("eye_base", "hand_base")


@pytest.mark.parametrize("variance", [np.nan, np.inf, -1e-6])
def test_invalid_covariance_is_reported(variance):
    """A damaged file may hold an invalid covariance; the other transforms remain available."""
    covariance = np.diag([variance, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
    damaged = {**CALIBRATION.transforms, BASE: PoseEstimate(CALIBRATION[BASE].mean, covariance)}
    calibration = replace(CALIBRATION, transforms=damaged)
    for name in (BASE, INVERSE):
        with pytest.raises(InputError, match=f"the covariance of {BASE} is none"):
            chosen_transforms(calibration, CELL, name)
    assert names(both_directions(calibration))[0] == MOUNT


def test_camera_frame_replaces_its_name():
    """A camera without a frame of another program keeps its own name."""
    for frame, name in ((None, "wrist"), ("optical", "optical")):
        camera = replace(CELL.cameras["wrist"], frame=frame)
        parent, child = frame_names(replace(CELL, cameras={**CELL.cameras, "wrist": camera}), MOUNT)
        assert child == name
        assert parent == frame_names(CELL, BASE.replace("_base_from_hand_base", "_flange_from_x"))[0]
