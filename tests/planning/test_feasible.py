"""Tests of the feasibility of samples: visibility, limits, reach and clear paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Robot, RobotState, Sample
from basecal.geometry import SE3, Camera
from basecal.kinematics.chain import SerialChain
from basecal.planning.feasible import (
    approach_poses,
    blocked_samples,
    is_clear,
    is_feasible,
    is_front_seen,
    is_in_view,
    is_path_clear,
    is_within_limits,
    points_in_image,
    reach_pose,
    reach_poses,
    visibility_mask,
    with_seen_distances,
)
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.ur5e import ur5e
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)
LENS = Camera("pinhole", np.array([100.0, 100.0, 49.5, 49.5]), (100, 100))


def move_flanges(**tangents):
    """Sample at home with flanges moved by tangents in their own axes."""
    states = dict(HOME)
    for robot, tangent in tangents.items():
        flange = SKETCH.base_from_flange(robot, HOME[robot]) @ SE3.exp(np.array(tangent, dtype=float))
        states[robot] = reach_pose(WORLD.cell.robots[robot], flange, HOME[robot])
    return Sample(0, robots=states)


def test_home_is_feasible():
    """The home of the arms passes all checks."""
    assert is_feasible(SKETCH, Sample(0, robots=HOME))


@pytest.mark.parametrize(
    "tangents",
    [{"hand": [-0.35, 0, 0, 0, 0, 0]}, {"hand": [0, 0, 0, 0, 1.4, 0]}, {"eye": [0, 0, 0, 0.6, 0, 0]}],
    ids=["aside", "from the side", "looking away"],
)
def test_target_out_of_view_is_detected(tangents):
    """A board that leaves the image, or is seen at a grazing angle, is not in view."""
    assert is_in_view(SKETCH, Sample(0, robots=HOME))
    assert not is_in_view(SKETCH, move_flanges(**tangents))


def test_touching_arms_are_not_clear():
    """With bases closer to one another the board comes within the margin of a link, and the sample is not clear."""
    sample, base = Sample(0, robots=HOME), SKETCH.transforms["eye_base_from_hand_base"]

    def nearer(m):
        closer = SE3(np.eye(3), np.array([-m, 0.0, 0.0])) @ base
        return replace(SKETCH, transforms={**SKETCH.transforms, "eye_base_from_hand_base": closer})

    assert is_clear(nearer(0.3), sample)
    assert not is_clear(nearer(0.6), sample)


def test_joint_beyond_limit_is_infeasible():
    """A sample with a joint beyond its limit is not within limits."""
    joints = WORLD.home["eye"].copy()
    joints[2] = 3.2
    assert is_within_limits(SKETCH, Sample(0, robots=HOME))
    assert not is_within_limits(SKETCH, Sample(0, robots={**HOME, "eye": RobotState(joints_rad=joints)}))


def test_path_through_other_arm_is_blocked():
    """Two postures are clear, but the path between them is not: an arm swings through the other one nearby."""
    near = move_flanges(eye=[0, 0, 0.4, 0, 0, 0], hand=[0, 0, 0.15, 0, 0, 0]).robots
    swings = [RobotState(joints_rad=near["eye"].joints_rad + angle * np.eye(6)[0]) for angle in (-0.9, 0.9)]
    through = [Sample(k, robots={**near, "eye": swing}) for k, swing in zip((4, 7), swings, strict=True)]
    assert all(is_clear(SKETCH, end) for end in through)
    assert not is_path_clear(SKETCH, *through)
    assert blocked_samples(SKETCH, through[0].robots, through) == [7]


def test_short_path_at_home_is_clear():
    """A rotation of the wrist at home is clear, with the arms half a metre apart.

    Paths of poses without joints are not checked.
    """
    other = move_flanges(eye=[0, 0, 0, 0, 0, 0.3])
    assert is_path_clear(SKETCH, Sample(0, robots=HOME), other)
    poses = Sample(1, robots={name: RobotState(SE3.identity()) for name in HOME})
    assert is_path_clear(SKETCH, other, poses)


ARM = Robot("eye", chain=ur5e())
NEAR_STATE = RobotState(joints_rad=np.array([0.3, -1.3, -1.8, -3.0, -1.2, 3.0]))


def test_nearby_pose_has_nearby_joints():
    """A pose nearby is reached by joints nearby, to 1e-9."""
    there = ur5e().forward(NEAR_STATE.joints_rad) @ SE3.exp(np.array([0.05, -0.02, 0.03, 0.1, 0.0, -0.1]))
    found = reach_pose(ARM, there, NEAR_STATE)
    assert np.abs((ur5e().forward(found.joints_rad).inverse() @ there).log()).max() < 1e-9
    assert np.abs(found.joints_rad - NEAR_STATE.joints_rad).max() < 0.5


def test_pose_out_of_reach_has_no_joints():
    """A pose two metres away has no joints. A robot that is sent to poses gets the pose itself."""
    far = SE3(np.eye(3), np.array([2.0, 0, 0]))
    assert reach_pose(ARM, far, NEAR_STATE) is None
    assert reach_pose(Robot("eye"), far, RobotState(SE3.identity())).base_from_flange is far


@pytest.mark.parametrize(("pixel", "seen"), [(1.9, False), (2.1, True), (96.9, True), (97.1, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_image_margin_holds_at_every_border(pixel, seen, axis):
    """The margin is two pixels inside of the centres of the first and the last pixel, 0 and 99."""
    at = np.array([49.5, 49.5])
    at[axis] = pixel
    point = np.append((at - 49.5) / 100, 1.0)
    assert points_in_image(LENS, point, 2.0) == seen


def test_points_behind_camera_are_not_visible():
    """Points behind the camera are not visible, whether the camera has an image size or not."""
    ends = np.array([[0, 0, 1.0], [0, 0, -1.0]])
    assert points_in_image(LENS, ends, 2.0).tolist() == [True, False]
    assert points_in_image(Camera("pinhole", LENS.parameters), ends, 2.0).tolist() == [True, False]


def facing(*centres, tilt_rad=0.0):
    """Poses of the board in the camera, with given centres [m] and a tilt about x."""
    turned = SE3.from_rotvec([tilt_rad, 0.0, 0.0], [0.0, 0.0, 0.0])
    middle = turned @ SKETCH.target_points.mean(0)
    return SE3.stack([SE3(turned.rotation, np.array(centre) - middle) for centre in centres])


def of_points(sketch, points=None):
    """The sketch of a target of these points; of a bare pose if there are none."""
    board = sketch.cell.targets["board"]
    shape = None if points is None else replace(board.target, points=points, sheets=())
    return replace(sketch, cell=replace(sketch.cell, targets={"board": replace(board, target=shape)}))


def without_lens(sketch):
    wrist = replace(sketch.cell.cameras["wrist"], intrinsics=None)
    return replace(sketch, cell=replace(sketch.cell, cameras={"wrist": wrist}))


def test_target_depth_is_limited():
    """Every point must be deeper than the minimal depth, and nearer than 3 m."""
    sketch = of_points(replace(SKETCH, nearest_m=0.3), np.array([[0.0, 0, 0], [0, 0, 0.1]]))
    poses = SE3(np.tile(np.eye(3), (4, 1, 1)), np.array([[0, 0, z] for z in (0.29, 0.31, 2.89, 2.91)]))
    assert visibility_mask(sketch, poses).tolist() == [False, True, True, False]


def test_board_is_visible_only_from_its_front():
    """A board is visible up to a cosine of 0.35 between the normal and the ray, for either sign of the tilt."""
    for degrees, seen in ((0, True), (68, True), (71, False), (-68, True), (-71, False), (180, False)):
        (found,) = visibility_mask(SKETCH, facing([0, 0, 1.0], tilt_rad=np.radians(degrees)))
        assert found == seen, degrees
    normal, centre = np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, -1.0]]), np.array([[0, 3, 4.0], [0, 4, 3.0], [0, 3, 4]])
    assert is_front_seen(normal, centre, 0.7).tolist() == [True, False, False]


def test_target_keeps_image_margin():
    """The margin is a twentieth of the image width at each border."""
    sketch = of_points(SKETCH)
    lens = sketch.lens
    width, height = lens.size_px
    margin = 0.05 * width
    for u, v, seen in (
        (margin + 1, height / 2, True),
        (margin - 1, height / 2, False),
        (width - 2 - margin, height / 2, True),
        (width - margin, height / 2, False),
        (width / 2, margin - 1, False),
        (width / 2, margin + 1, True),
        (width / 2, height - margin, False),
    ):
        (ray,), _ = lens.undistort(np.array([[u, v]]))
        pose = SE3(np.eye(3), ray)
        assert visibility_mask(sketch, SE3.stack([pose])).tolist() == [seen], (u, v)


def test_field_of_view_without_lens():
    """Without a lens all points must be within 25.8 degrees of the optical axis."""
    sketch = of_points(without_lens(SKETCH), np.array([[0.0, 0, 0], [0.1, 0, 0]]))
    angles = np.radians([0, 24, 27])
    poses = SE3(np.tile(np.eye(3), (3, 1, 1)), np.array([[np.tan(a) - 0.1, 0, 1.0] for a in angles]))
    assert visibility_mask(sketch, poses).tolist() == [True, True, False]


def test_minimal_depth_is_that_of_views():
    """The minimal depth is the smallest of views that show the target, and at most the assumed one."""
    start = Sample(0, robots=HOME)
    depth = (SKETCH.camera_from_target(start) @ SKETCH.target_points)[:, 2].min()
    away = move_flanges(eye=[0, 0, -0.05, 0, 0, 0]).robots
    aside = move_flanges(eye=[0, 0, 0.2, 0.6, 0, 0]).robots
    assert not is_in_view(SKETCH, Sample(0, robots=aside))
    far = replace(SKETCH, nearest_m=1.0)
    assert with_seen_distances(far, [away, HOME, aside]).nearest_m == pytest.approx(depth)
    assert with_seen_distances(far, [aside]).nearest_m == 1.0
    assert with_seen_distances(SKETCH, [HOME]).nearest_m == SKETCH.nearest_m


def test_joints_at_limits_are_within_them():
    """Each joint has its own inclusive limits. A robot that is sent to poses, or without a chain, has none."""
    chain = WORLD.cell.robots["eye"].chain
    for joints, inside in (
        (chain.lower, True),
        (chain.upper, True),
        (chain.upper + 1e-6 * np.eye(6)[3], False),
        (chain.lower - 1e-6 * np.eye(6)[5], False),
    ):
        assert is_within_limits(SKETCH, Sample(0, robots={**HOME, "eye": RobotState(joints_rad=joints)})) == inside
        assert is_within_limits(SKETCH, Sample(0, robots={**HOME, "hand": RobotState(joints_rad=joints)})) == inside
    assert is_within_limits(SKETCH, Sample(0, robots={"eye": RobotState(SE3.identity())}))


def test_batch_of_poses_is_solved_individually():
    """A pose out of reach has no joints, the others do. Without initial joints all poses are returned unchanged."""
    there = ur5e().forward(NEAR_STATE.joints_rad) @ SE3.exp(np.array([0.02, -0.01, 0.03, 0.1, 0.0, -0.1]))
    goals = SE3.stack([there, SE3(np.eye(3), np.array([2.0, 0, 0])), ur5e().forward(NEAR_STATE.joints_rad)])
    first, far, last = reach_poses(ARM, goals, [NEAR_STATE] * 3)
    assert far is None
    np.testing.assert_allclose(ur5e().forward(first.joints_rad).matrix, there.matrix, atol=1e-7)
    np.testing.assert_allclose(last.joints_rad, NEAR_STATE.joints_rad)
    by_pose = RobotState(SE3.identity())
    for robot, starts in (
        (Robot("eye"), [NEAR_STATE] * 3),
        (ARM, [NEAR_STATE, by_pose, by_pose]),
        (ARM, [by_pose] * 3),
    ):
        found = reach_poses(robot, goals, starts)
        np.testing.assert_array_equal([each.base_from_flange.matrix for each in found], goals.matrix)
    assert reach_pose(ARM, there, by_pose).base_from_flange is there


@pytest.mark.parametrize(("joints", "reached"), [(5, True), (6, False)])
def test_arm_with_few_joints_approaches_pose(joints, reached):
    """An arm of five joints approaches a pose as far as possible. An arm of six or more reaches it or fails."""
    whole = ur5e()
    parts = (getattr(whole, part)[:joints] for part in ("joint_names", "origins", "axes"))
    arm = SerialChain(*parts, whole.tip, whole.lower[:joints], whole.upper[:joints])
    start = RobotState(joints_rad=NEAR_STATE.joints_rad[:joints])
    goals = SE3.stack([arm.forward(start.joints_rad) @ SE3.exp(np.array([0.0, 0, 3.0, 0.0, 0.2, 0]))])
    (found,) = approach_poses(Robot("eye", chain=arm), goals, [start])
    assert (found is not None) == reached
