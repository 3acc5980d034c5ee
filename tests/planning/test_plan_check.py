"""Tests of the check of plans before any robot moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, KeepOut, Robot, RobotState, Sample, Unknown
from basecal.geometry import SE3
from basecal.kinematics import read_chain
from basecal.planning.clearance import Clearance, path_m_per_rad
from basecal.planning.plan_check import SpeedLimits, _path_refusals, _state_refusals, check_plan, timed_path
from basecal.planning.sketch import Sketch, sketch_cell
from shared.facing_arms import facing_arms

WORLD = facing_arms("charuco")
SKETCH = sketch_cell(WORLD.cell)
HOME = {name: RobotState(joints_rad=joints) for name, joints in WORLD.home.items()}
LIMITS = SpeedLimits(np.radians(30.0), 0.25)
WILLING = dict.fromkeys(HOME, lambda state: "")


def rotate_joint(robot, joint, by_rad, number=1):
    """Sample at home with one joint of one robot rotated."""
    joints = WORLD.home[robot].copy()
    joints[joint] += by_rad
    return Sample(number, robots={**HOME, robot: RobotState(joints_rad=joints)})


def box_at(point, size_m=0.02):
    """A small box in the world."""
    return KeepOut("post", SE3(np.eye(3), np.asarray(point)), np.full(3, size_m))


def words(plan, sketch=SKETCH, asks=WILLING):
    """Texts of the refusals of a plan."""
    return [str(refusal) for refusal in check_plan(sketch, HOME, plan, LIMITS, asks).refusals]


def test_valid_plan_is_accepted():
    """Small rotations of the wrist are clear, and every robot has a path to each sample."""
    found = check_plan(SKETCH, HOME, [rotate_joint("eye", 5, 0.3), rotate_joint("hand", 5, -0.3, 2)], LIMITS, WILLING)
    assert found.refusals == ()
    assert [(way.sample, way.robot) for way in found.paths] == [(1, "eye"), (1, "hand"), (2, "eye"), (2, "hand")]


def test_joint_beyond_limits_is_refused():
    """The refusal names the joint with its value and its limits, for any robot and sample."""
    limit = WORLD.cell.robots["hand"].chain.upper[2]
    over = rotate_joint("hand", 2, limit + 0.01 - WORLD.home["hand"][2], 3)
    (why,) = words([rotate_joint("eye", 5, 0.1), over])
    assert why.startswith(f"sample 3: joint elbow of hand is {limit + 0.01:.4g} rad, but its limits are")


def test_nan_joint_is_refused():
    """A NaN is beyond all limits."""
    (why,) = words([rotate_joint("eye", 4, np.nan)])
    assert why.startswith("sample 1: joint wrist_2 of eye is nan rad")


def test_unlimited_joint_is_bounded():
    """Degrees given as radians to a continuous joint are refused before the path is checked."""
    free = replace(WORLD.cell.robots["eye"].chain, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    robots = {**WORLD.cell.robots, "eye": replace(WORLD.cell.robots["eye"], chain=free)}
    endless = replace(SKETCH, cell=replace(WORLD.cell, robots=robots))
    for wild in (50.0, 1e3):
        assert words([rotate_joint("eye", 5, wild)], sketch=endless)


def test_controller_is_asked_about_every_sample():
    """The plan refuses what the controller refuses. Robots that are not sent are not asked."""
    angles = []

    def eye(state):
        angles.append(state.joints_rad[5])
        return "" if len(angles) < 2 else "the goal is beyond the safety limits"

    (why,) = words([rotate_joint("eye", 5, 0.1), rotate_joint("eye", 5, 0.2, 2)], asks={"eye": eye})
    assert why.startswith("sample 2: eye: the goal is beyond the safety limits")
    assert len(angles) == 2


def test_keep_out_boxes_block_paths_except_tables():
    """A post between two samples is refused though both are clear of it; a table under the bases is not."""
    start, end = rotate_joint("eye", 0, -0.6, 1), rotate_joint("eye", 0, 0.6, 2)
    middle = SKETCH.body_pose(SKETCH.camera.name, rotate_joint("eye", 0, 0.0).robots).translation
    alone = replace(WORLD.cell, keep_out={"post": box_at(middle)})
    before = {**HOME, **start.robots}
    found = check_plan(replace(SKETCH, cell=alone), before, [end], LIMITS, {"eye": lambda state: ""})
    assert [refusal.what for refusal in found.refusals] == [
        "eye comes within 0 mm of 'post' on its way, 20 mm are required"
    ]
    table = KeepOut("table", SE3(np.eye(3), np.array([0.0, 0.0, -10.0])), np.full(3, 20.0))
    on_table = replace(WORLD.cell, keep_out={"table": table})
    assert words([rotate_joint("eye", 5, 0.3)], sketch=replace(SKETCH, cell=on_table)) == []


def points_of(robots):
    """Origins of the eye's joints, its flange and its camera, by the kinematics alone."""
    chain = WORLD.cell.robots["eye"].chain
    frames = [*chain.joint_frames(robots["eye"].joints_rad), chain.forward(robots["eye"].joints_rad)]
    return np.stack(
        [*(frame.translation for frame in frames), SKETCH.body_pose(SKETCH.camera.name, robots).translation]
    )


def test_speed_is_limited_by_fastest_point():
    """The speed of a path is limited such that the fastest point of the arm reaches the limit.

    Slow paths are unchanged.
    """
    start, end = Sample(0, robots=HOME), rotate_joint("eye", 0, 0.5)
    way = timed_path(SKETCH, start, end, "eye", SpeedLimits(np.radians(30.0), 0.1))
    places = np.stack([points_of(rotate_joint("eye", 0, share * 0.5).robots) for share in np.linspace(0, 1, 400)])
    metres = np.linalg.norm(np.diff(places, axis=0), axis=-1).max() * 399 / 0.5
    assert way.joint_rad_s * metres == pytest.approx(0.1 / 1.02, rel=0.005)
    assert way.tool_m_s == pytest.approx(0.1)
    wrist = timed_path(SKETCH, start, rotate_joint("eye", 5, 0.5), "eye", LIMITS)
    assert wrist.joint_rad_s == pytest.approx(np.radians(30.0))
    assert wrist.tool_m_s < 0.25


def test_robot_without_kinematics_has_speed_bound():
    """The joint speed of a robot sent to poses is limited by three times its reach per radian.

    No point then exceeds the limit.
    """
    bare = replace(WORLD.cell, robots={**WORLD.cell.robots, "eye": replace(WORLD.cell.robots["eye"], chain=None)})
    poses = [RobotState(SE3(np.eye(3), np.array([0.5, y, 0.0]))) for y in (0.0, 0.1)]
    start, end = (Sample(k, robots={"eye": pose}) for k, pose in enumerate(poses))
    way = timed_path(replace(SKETCH, cell=bare), start, end, "eye", LIMITS)
    assert way.joint_rad_s == pytest.approx(0.25 / (3 * (np.hypot(0.5, 0.1) + 0.3)))
    assert way.tool_m_s == pytest.approx(0.25)
    stated = replace(bare, robots={**bare.robots, "eye": replace(bare.robots["eye"], reach_m=0.85)})
    way = timed_path(replace(SKETCH, cell=stated), start, end, "eye", LIMITS)
    assert way.joint_rad_s == pytest.approx(0.25 / (3 * (0.85 + 0.3)))


@pytest.mark.parametrize(("turns", "refused"), [(2.04, False), (2.06, True), (-2.04, False), (-2.06, True)])
def test_path_is_limited_to_two_turns(turns, refused):
    """A joint without limits may rotate by two turns in either direction. The refusal states what to do."""
    free = replace(WORLD.cell.robots["eye"].chain, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    robots = {**WORLD.cell.robots, "eye": replace(WORLD.cell.robots["eye"], chain=free)}
    endless = replace(SKETCH, cell=replace(WORLD.cell, robots=robots))
    found = words([rotate_joint("eye", 5, turns * 2 * np.pi)], sketch=endless)
    assert bool(found) == refused
    for why in found:
        assert why == (
            f"sample 1: a joint of eye would turn by {abs(turns) * 2 * np.pi:.4g} rad, more than two turns. "
            "State joints in rad, within two turns of the sample before."
        )


def test_robot_without_goal_keeps_last_goal():
    """Another arm passes such a robot as if its goal were repeated, and its next path begins there."""
    first, second = rotate_joint("eye", 0, 0.5), rotate_joint("hand", 0, 0.1, 2).robots["hand"]
    full = [first, Sample(2, robots={**first.robots, "hand": second}), Sample(3, robots={"eye": first.robots["eye"]})]
    brief = [first, Sample(2, robots={"hand": second}), full[2]]
    ways, brief_ways = (check_plan(SKETCH, HOME, plan, LIMITS, WILLING).paths for plan in (full, brief))
    assert [way for way in ways if way.robot == "hand"] == [way for way in brief_ways if way.robot == "hand"]
    assert brief_ways[-1].tool_m_s == 0.0


@pytest.mark.parametrize(("over_rad", "refused"), [(0.0, False), (0.9e-9, False), (1e-8, True)])
def test_joint_at_limit_is_accepted(over_rad, refused):
    """A joint at either limit is accepted, up to rounding."""
    chain = WORLD.cell.robots["eye"].chain
    for joint, limit in ((5, chain.lower[5] - over_rad), (5, chain.upper[5] + over_rad)):
        joints = WORLD.home["eye"].copy()
        joints[joint] = limit
        state = RobotState(joints_rad=joints)
        found = _state_refusals(SKETCH, HOME["eye"], Sample(1, robots={"eye": state}), "eye", lambda state: "")
        assert [f"joint {chain.joint_names[joint]} of eye" in each.what for each in found] == [True] * refused


def test_a_pose_out_of_reach_is_refused():
    """The controller is asked about reachable poses, and its reason is reported."""
    far = RobotState(SE3(np.eye(3), np.array([9.0, 0, 0])))
    near = RobotState(SKETCH.base_from_flange("eye", HOME["eye"]))

    def found(state, why=""):
        sample = Sample(4, robots={"eye": state})
        return [str(each) for each in _state_refusals(SKETCH, HOME["eye"], sample, "eye", lambda state: why)]

    assert found(far) == ["sample 4: eye does not reach the pose. Bring the pose nearer to its base."]
    assert found(near) == []
    assert found(near, "it is tired") == [
        "sample 4: eye: it is tired. Change the plan, or the limits on its controller."
    ]


def test_small_gaps_are_reported_in_millimetres():
    """Gaps that are too small are reported in mm; inside of a body the gap is zero."""
    gaps = [Clearance("eye", "post", gap_m, 0.02) for gap_m in (0.0123, 0.02, 0.0199, -0.3)]
    assert [each.what for each in _path_refusals(Sample(7), gaps)] == [
        f"eye comes within {gap} mm of 'post' on its way, 20 mm are required" for gap in (12, 20, 0)
    ]
    assert {each.sample for each in _path_refusals(Sample(7), gaps)} == {7}


def test_still_robot_has_joint_speed_limit():
    """A still robot has no tool speed and the full joint speed. The gaps of a path are those of its robot."""
    pairs = (("eye", "hand"), ("hand", "post"), ("eye", "post"))
    gaps = [Clearance(robot, other, 0.1, 0.02) for robot, other in pairs]
    here = Sample(3, robots=HOME)
    way = timed_path(SKETCH, here, here, "eye", LIMITS, gaps)
    assert (way.sample, way.joint_rad_s, way.tool_m_s) == (3, LIMITS.joint_rad_s, 0.0)
    assert way.gaps == (gaps[0], gaps[2])
    assert timed_path(SKETCH, here, here, "hand", LIMITS, gaps).gaps == (gaps[0], gaps[1])


def test_unsent_robot_keeps_its_state():
    """Each path begins at the last sample of its robot, initially at home."""
    alone = [
        Sample(1, robots={"eye": rotate_joint("eye", 5, 0.3).robots["eye"]}),
        Sample(2, robots={"hand": HOME["hand"]}),
    ]
    found = check_plan(SKETCH, HOME, alone, LIMITS, WILLING)
    assert [(way.sample, way.robot) for way in found.paths] == [(1, "eye"), (2, "hand")]
    assert found.paths[0].tool_m_s > 0
    assert found.paths[1].tool_m_s == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["six_axis", "seven_axis"])
def test_three_reaches_bound_the_fastest_point(name):
    """Three times the reach bounds the fastest point of an arm with unknown kinematics.

    The worst of many random paths is made worse step by step, and stays slower than stated. The reach is 0.7 of the
    farthest flange, about what a data sheet states, and a camera is 0.3 m from the flange.
    """
    ends = {"six_axis": ("base_link", "tool0"), "seven_axis": ("pedestal", "hand")}[name]
    chain = read_chain(Path(__file__).parents[1] / f"data/urdf/{name}.urdf", *ends)
    lower, upper = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    rng, camera = np.random.default_rng(0), CellCamera("wrist", "eye", Unknown(), "pinhole")
    mounts = {"eye_flange_from_wrist": SE3(np.eye(3), np.array([0.1, 0, 0.28]))}
    sketch = Sketch(Cell("eye", {"eye": Robot("eye", None, chain)}, cameras={"wrist": camera}), mounts, ("wrist", "x"))
    reach = np.linalg.norm(chain.forward(rng.uniform(lower, upper, (20000, chain.n))).translation, axis=-1).max()

    def length(way):
        return path_m_per_rad(sketch, *(Sample(0, robots={"eye": RobotState(joints_rad=q)}) for q in way), "eye")

    worst = max((rng.uniform(lower, upper, (2, chain.n)) for _ in range(50)), key=length)
    step = 0.8
    for _ in range(600):
        tried = np.clip(worst + step * rng.standard_normal(worst.shape) * (rng.random(worst.shape) < 0.4), lower, upper)
        worst, step = (tried, step) if length(tried) > length(worst) else (worst, max(0.99 * step, 0.02))
    assert 2 < length(worst) / (0.7 * reach + 0.3) < 3
