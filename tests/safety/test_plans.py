"""Tests of random plans: each plan with a fault is refused before any motion; correct plans are accepted.

Pinocchio judges the faults: a post is where Pinocchio places the camera, arms are where Pinocchio lets their wrists
meet, and no flange or camera of a correct plan is faster than allowed by its Jacobians.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from basecal.cell import KeepOut, RobotState, Sample
from basecal.geometry import SE3
from basecal.planning.plan_check import SpeedLimits, check_plan
from basecal.planning.sketch import sketch_cell
from shared.facing_arms import facing_arms

pytestmark = pytest.mark.timed

pin = pytest.importorskip("pinocchio")

WORLD = facing_arms("charuco")
SKETCH = sketch_cell(WORLD.cell)
CHAIN = WORLD.cell.robots["eye"].chain
HOME = {name: RobotState(joints_rad=joints) for name, joints in WORLD.home.items()}
LIMITS = SpeedLimits(np.radians(30.0), 0.25)
WILLING = dict.fromkeys(HOME, lambda state: "")
PLANS, SAMPLES = int(os.environ.get("PLANS", "300")), 6
HOLD_M = 0.1  # from a box's middle, or between wrists: far within what must be refused


@cache
def model():
    """Model of the eye's arm in Pinocchio, with its flange as the last frame."""
    arm, parent = pin.Model(), 0
    for name, origin, axis in zip(CHAIN.joint_names, CHAIN.origins, CHAIN.axes, strict=True):
        placement = pin.SE3(np.array(origin.rotation), np.array(origin.translation))
        parent = arm.addJoint(parent, pin.JointModelRevoluteUnaligned(np.array(axis)), placement, name)
    tip = pin.SE3(np.array(CHAIN.tip.rotation), np.array(CHAIN.tip.translation))
    arm.addFrame(pin.Frame("flange", parent, 0, tip, pin.FrameType.OP_FRAME))
    return arm, arm.createData()


def flange(joints):
    """Position of the flange by Pinocchio, and the derivative of its position to the joints, (3, 6)."""
    arm, data = model()
    jacobian = pin.computeFrameJacobian(arm, data, np.array(joints), arm.getFrameId("flange"), pin.LOCAL_WORLD_ALIGNED)
    pin.updateFramePlacements(arm, data)
    return data.oMf[arm.getFrameId("flange")].translation.copy(), jacobian[:3]


@cache
def sound(seed):
    """Plan near home, where the arms face each other at half a metre: each joint within 0.15 rad of home."""
    rng = np.random.default_rng([7, seed])
    return tuple(
        Sample(
            number,
            robots={
                name: RobotState(joints_rad=state.joints_rad + rng.uniform(-0.15, 0.15, 6))
                for name, state in HOME.items()
            },
        )
        for number in range(SAMPLES)
    )


def refusals(plan, cell=WORLD.cell):
    """Reasons for which a plan is refused."""
    return check_plan(replace(SKETCH, cell=cell), HOME, plan, LIMITS, WILLING).refusals


def changed(plan, place, robot, joints):
    """Copy of the plan with other joints of one robot in one sample."""
    sample = plan[place]
    robots = {**sample.robots, robot: RobotState(joints_rad=np.asarray(joints))}
    return (*plan[:place], replace(sample, robots=robots), *plan[place + 1 :])


def test_plans_beyond_a_joint_limit_are_refused():
    """A hundred plans with one joint beyond its limit by a milliradian or more, in one sample of one robot."""
    rng = np.random.default_rng(1)
    for k in range(PLANS // 3):
        plan, robot = sound(k), ("eye", "hand")[k % 2]
        place, joint = rng.integers(SAMPLES), rng.integers(6)
        joints = np.array(plan[place].robots[robot].joints_rad)
        beyond = rng.uniform(1e-3, 4.0)
        joints[joint] = CHAIN.upper[joint] + beyond if rng.random() < 0.5 else CHAIN.lower[joint] - beyond
        assert any("its limits are" in each.what for each in refusals(changed(plan, place, robot, joints)))


def test_plans_through_a_post_are_refused():
    """A hundred plans with a thin post on the way of the eye's flange by Pinocchio, also between samples."""
    rng = np.random.default_rng(2)
    for k in range(PLANS // 3):
        plan = sound(k)
        stops = [HOME["eye"].joints_rad, *(sample.robots["eye"].joints_rad for sample in plan)]
        start, end = list(pairwise(stops))[rng.integers(SAMPLES)]
        at, _ = flange(start + rng.uniform(0.2, 0.8) * (end - start))
        post = KeepOut("post", SE3(np.eye(3), at), np.array([0.02, 0.02, 0.4]))
        found = refusals(plan, replace(WORLD.cell, keep_out={"post": post}))
        assert any("'post'" in each.what for each in found)


def reaching(robot, there, start):
    """Joints near a start that move a robot's flange to a point of the world, by Pinocchio."""
    in_base = SKETCH.world_from_base(robot).inverse() @ there
    joints = np.array(start)
    for _ in range(200):
        at, jacobian = flange(joints)
        joints = joints + np.clip(np.linalg.pinv(jacobian, 1e-2) @ (in_base - at), -0.1, 0.1)
    joints = (joints + np.pi) % (2 * np.pi) - np.pi
    assert np.linalg.norm(flange(joints)[0] - in_base) < HOLD_M
    return joints


def test_plans_with_colliding_arms_are_refused():
    """A hundred plans in which both flanges move to one point between the bases, in one sample."""
    rng = np.random.default_rng(3)
    middle = 0.5 * SKETCH.world_from_base("hand").translation
    for k in range(PLANS // 3):
        plan, place = sound(k), int(rng.integers(SAMPLES))
        there = middle + np.array([0.0, 0.0, 0.4]) + rng.uniform(-0.1, 0.1, 3)
        for robot in ("eye", "hand"):
            plan = changed(plan, place, robot, reaching(robot, there, plan[place].robots[robot].joints_rad))
        assert refusals(plan)


def test_correct_plans_are_accepted_and_slow_enough():
    """Three hundred plans are accepted, and by Pinocchio's Jacobians no flange is faster than allowed."""
    fastest = 0.0
    for seed in range(PLANS):
        plan = sound(seed)
        found = check_plan(SKETCH, HOME, plan, LIMITS, WILLING)
        assert found.refusals == ()
        speeds = {way.sample: way.joint_rad_s for way in found.paths if way.robot == "eye"}
        for start, end in pairwise([Sample(-1, robots=HOME), *plan]):
            here, there = (each.robots["eye"].joints_rad for each in (start, end))
            rates = (there - here) / np.abs(there - here).max() * speeds[end.sample]
            along = [np.linalg.norm(flange(here + s * (there - here))[1] @ rates) for s in np.linspace(0, 1, 9)]
            fastest = max(fastest, *along)
    assert 0.1 < fastest < 0.25 * 1.001
