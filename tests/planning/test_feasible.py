"""Whether a sample can be taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Robot, RobotState, Sample
from basecal.geometry import SE3, Camera
from basecal.planning.feasible import (
    blocked_samples,
    is_clear,
    is_feasible,
    is_in_view,
    is_path_clear,
    is_within_limits,
    points_in_image,
    reach_pose,
)
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.ur5e import ur5e
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)
LENS = Camera("pinhole", np.array([100.0, 100.0, 49.5, 49.5]), (100, 100))


def moved(**tangents):
    """The home with flanges moved by tangents in their own axes."""
    states = dict(HOME)
    for robot, tangent in tangents.items():
        flange = SKETCH.base_from_flange(robot, HOME[robot]) @ SE3.exp(np.array(tangent, dtype=float))
        states[robot] = reach_pose(WORLD.cell.robots[robot], flange, HOME[robot])
    return Sample(0, robots=states)


def test_home_is_feasible():
    """Where the arms begin, everything is in order."""
    assert is_feasible(SKETCH, Sample(0, robots=HOME))


@pytest.mark.parametrize(
    "tangents",
    [{"hand": [-0.35, 0, 0, 0, 0, 0]}, {"hand": [0, 0, 0, 0, 1.4, 0]}, {"eye": [0, 0, 0, 0.6, 0, 0]}],
    ids=["aside", "from the side", "looking away"],
)
def test_what_is_out_of_view(tangents):
    """A board that leaves the image, or is seen too flat, is not in view."""
    assert is_in_view(SKETCH, Sample(0, robots=HOME))
    assert not is_in_view(SKETCH, moved(**tangents))


def test_arms_that_meet():
    """With bases nearer to one another the board comes within the room of a link, and that is not clear."""
    sample, base = Sample(0, robots=HOME), SKETCH.transforms["eye_base_from_hand_base"]

    def nearer(m):
        closer = SE3(np.eye(3), np.array([-m, 0.0, 0.0])) @ base
        return replace(SKETCH, transforms={**SKETCH.transforms, "eye_base_from_hand_base": closer})

    assert is_clear(nearer(0.3), sample)
    assert not is_clear(nearer(0.6), sample)


def test_limits():
    """Joints beyond a limit are out."""
    joints = WORLD.home["eye"].copy()
    joints[2] = 3.2
    assert is_within_limits(SKETCH, Sample(0, robots=HOME))
    assert not is_within_limits(SKETCH, Sample(0, robots={**HOME, "eye": RobotState(joints_rad=joints)}))


def test_arms_that_pass_through_one_another():
    """Two places that are clear, the way between which is not: an arm swings past the other, which is near."""
    near = moved(eye=[0, 0, 0.4, 0, 0, 0], hand=[0, 0, 0.15, 0, 0, 0]).robots
    swings = [RobotState(joints_rad=near["eye"].joints_rad + angle * np.eye(6)[0]) for angle in (-0.9, 0.9)]
    through = [Sample(k, robots={**near, "eye": swing}) for k, swing in zip((4, 7), swings, strict=True)]
    assert all(is_clear(SKETCH, end) for end in through)
    assert not is_path_clear(SKETCH, *through)
    assert blocked_samples(SKETCH, through[0].robots, through) == [7]


def test_a_short_way_at_home_is_clear():
    """As the arms begin, half a metre apart, a turn of the wrist is no danger; of poses nothing is known."""
    other = moved(eye=[0, 0, 0, 0, 0, 0.3])
    assert is_path_clear(SKETCH, Sample(0, robots=HOME), other)
    poses = Sample(1, robots={name: RobotState(SE3.identity()) for name in HOME})
    assert is_path_clear(SKETCH, other, poses)


ARM = Robot("eye", chain=ur5e())
NEAR_STATE = RobotState(joints_rad=np.array([0.3, -1.3, -1.8, -3.0, -1.2, 3.0]))


def test_joints_near_those_it_has():
    """A pose a little away is reached by joints a little away, to 1e-9."""
    there = ur5e().forward(NEAR_STATE.joints_rad) @ SE3.exp(np.array([0.05, -0.02, 0.03, 0.1, 0.0, -0.1]))
    found = reach_pose(ARM, there, NEAR_STATE)
    assert np.abs((ur5e().forward(found.joints_rad).inverse() @ there).log()).max() < 1e-9
    assert np.abs(found.joints_rad - NEAR_STATE.joints_rad).max() < 0.5


def test_out_of_reach_and_by_poses():
    """Two metres away there are none; a robot that is sent to poses is sent there."""
    far = SE3(np.eye(3), np.array([2.0, 0, 0]))
    assert reach_pose(ARM, far, NEAR_STATE) is None
    assert reach_pose(Robot("eye"), far, RobotState(SE3.identity())).base_from_flange is far


@pytest.mark.parametrize(("pixel", "seen"), [(1.9, False), (2.1, True), (96.9, True), (97.1, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_margin_is_kept_at_every_border(pixel, seen, axis):
    """Two pixels inside of the first and the last pixel's centre, 0 and 99."""
    at = np.array([49.5, 49.5])
    at[axis] = pixel
    point = np.append((at - 49.5) / 100, 1.0)
    assert points_in_image(LENS, point, 2.0) == seen


def test_what_is_behind_is_not_seen():
    """Of a camera that says its size, and of one that does not."""
    ends = np.array([[0, 0, 1.0], [0, 0, -1.0]])
    assert points_in_image(LENS, ends, 2.0).tolist() == [True, False]
    assert points_in_image(Camera("pinhole", LENS.parameters), ends, 2.0).tolist() == [True, False]
