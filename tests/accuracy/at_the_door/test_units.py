"""Units that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.at_the_door.units import impossible_units
from basecal.accuracy.input_check.hypotheses import resized
from basecal.accuracy.input_check.rewriting import scaled, with_joints, with_points, with_robots, with_targets
from basecal.cell import Recording, RobotState
from basecal.simulation import Scenario, simulate


def codes(cell, recording):
    return [(each.code, each.severity, each.about) for each in impossible_units(cell, recording)]


@pytest.mark.parametrize("kept", [{}, {"joints": True}, {"target": "pose"}, {"target": "points3d"}, {"target": "led"}])
def test_a_cell_in_order_has_none(kept):
    """Poses, joints, points and lights, as they are."""
    made = simulate(Scenario(samples=5, **kept), 3)
    assert codes(made.cell, made.recording) == []
    assert codes(made.cell, Recording()) == []


@pytest.mark.parametrize("robots", [("hand",), ("eye", "hand")])
def test_joints_in_degrees(robots):
    """Of one robot or all: they turn farther than joints do, and in degrees would not."""
    made = simulate(Scenario(samples=8, joints=True), 0)
    recording = made.recording
    for name in robots:
        recording = with_joints(recording, name, 180 / np.pi)
    assert codes(made.cell, recording) == [("angle-unit", "error", robots)]


def test_a_wrist_without_end_is_none():
    """One joint that has turned many times is told by nothing."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    turned = [
        replace(s, robots={**s.robots, "hand": RobotState(joints_rad=s.robots["hand"].joints_rad + 40 * np.eye(6)[5])})
        for s in made.recording.samples
    ]
    assert codes(made.cell, replace(made.recording, samples=tuple(turned))) == []


def test_robots_in_millimetres():
    """Each that is, and no other."""
    made = simulate(Scenario(samples=5), 0)
    one = with_robots(made.recording, {"hand": scaled(1000)})
    assert codes(made.cell, one) == [("length-unit", "error", ("hand",))]
    (both,) = impossible_units(made.cell, with_robots(made.recording, dict.fromkeys(("eye", "hand"), scaled(1000))))
    assert both.about == ("eye", "hand")
    assert both.message.startswith("the poses of eye and hand are in millimetres: lengths are in metres, divide")


def test_what_was_seen_in_millimetres():
    """Poses, 3-D points, and the board's size."""
    poses = simulate(Scenario(samples=5, target="pose"), 0)
    assert codes(poses.cell, with_targets(poses.recording, scaled(1000))) == [("length-unit", "error", ())]
    points = simulate(Scenario(samples=5, target="points3d"), 0)
    assert codes(points.cell, with_points(points.recording, 1000)) == [("length-unit", "error", ())]
    board = simulate(Scenario(samples=5), 0)
    assert codes(resized(board.cell, {"board": 1000.0}), board.recording) == [("board-size", "error", ("board",))]


@pytest.mark.parametrize(("end", "off_rad", "told"), [("lower", -0.09, True), ("lower", -0.11, False),
                                                      ("upper", 0.09, True), ("upper", 0.11, False)])  # fmt: skip
def test_degrees_are_such_as_the_urdf_lets_be(end, off_rad, told):
    """A tenth of a radian beyond a limit is borne; farther, degrees would be no posture of the arm either."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    chain = made.cell.robots["hand"].chain
    narrow = replace(chain, lower=np.full(6, -2.0), upper=np.full(6, 2.0))
    cell = replace(made.cell, robots={**made.cell.robots, "hand": replace(made.cell.robots["hand"], chain=narrow)})
    joints = np.degrees(np.array([[1.5, -1.5, 1.0, 0.5, 0.2, 0.1]] * 6))
    joints[2, 3] = np.degrees(getattr(narrow, end)[3] + off_rad)
    samples = [
        replace(s, robots={**s.robots, "hand": RobotState(joints_rad=q)})
        for s, q in zip(made.recording.samples, joints, strict=True)
    ]
    assert bool(codes(cell, replace(made.recording, samples=tuple(samples)))) == told
