"""Tests of the written forms of a plan."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from basecal.cell import RobotState
from basecal.errors import InputError
from basecal.exchange.motions.writers import write_goals, write_joints, write_table, write_ur_script
from basecal.geometry import SE3
from shared.motion_ways import HOLD_S, joint_way, planned_joints, pose_way


def test_table_rows_are_samples() -> None:
    """Rows have the joints of both arms and the poses of their flanges, which agree by the arms' kinematics."""
    way = joint_way()
    rows = list(csv.DictReader(io.StringIO(write_table(way))))
    assert [int(row["sample"]) for row in rows] == [20, 21, 22]
    for robot in way.robots:
        joints = np.array([[float(row[f"{robot}_{name}_rad"]) for name in way.joint_names(robot)] for row in rows])
        assert np.allclose(joints, planned_joints(way, robot), atol=1e-8)
        placed = [[float(row[f"{robot}_{axis}_m"]) for axis in "xyz"] for row in rows]
        assert np.allclose(placed, [way.pose(robot, sample).translation for sample in way.samples], atol=1e-8)


def test_robot_of_poses_writes_poses_only() -> None:
    """The table has no joint columns, and unit quaternions."""
    rows = list(csv.DictReader(io.StringIO(write_table(pose_way()))))
    assert list(rows[0]) == ["sample", *(f"hand_{name}" for name in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"))]
    quaternion = [float(rows[1][f"hand_q{axis}"]) for axis in "xyzw"]
    assert abs(np.linalg.norm(quaternion) - 1) < 1e-8


def test_robot_with_some_joints_writes_poses_only() -> None:
    """Every row has as many numbers as the header."""
    way = joint_way("hand")
    first, *others = way.samples
    pose = RobotState(way.pose("hand", first))
    mixed = replace(way, samples=(replace(first, robots={"hand": pose}), *others))
    lengths = {len(row) for row in csv.reader(io.StringIO(write_table(mixed)))}
    assert lengths == {8}


def test_joints_file_keeps_every_digit() -> None:
    """The plan is read back exactly, in the chain's order."""
    way = joint_way()
    found = json.loads(write_joints(way))
    assert found["samples"] == [20, 21, 22]
    for robot, of in found["robots"].items():
        assert tuple(of["joint_names"]) == way.joint_names(robot)
        assert np.array_equal(of["joints_rad"], planned_joints(way, robot))


def test_goals_are_synchronised() -> None:
    """Each arm has a document with the fields of JointTrajectory.

    All arms reach each sample at the same time, and hold.
    """
    way = joint_way()
    goals = [each["trajectory"] for each in YAML(typ="safe", pure=True).load_all(write_goals(way))]
    assert len(goals) == 2
    times = []
    for robot, goal in zip(way.robots, goals, strict=True):
        assert tuple(goal["joint_names"]) == way.joint_names(robot)
        points = goal["points"]
        assert np.allclose(
            [p["positions"] for p in points], np.repeat(planned_joints(way, robot), 2, axis=0), atol=1e-8
        )
        assert not np.any([p["velocities"] for p in points])
        times.append([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    assert times[0] == times[1]
    assert np.allclose(np.diff(times[0])[::2], HOLD_S)
    assert np.all(np.diff(times[0]) > 0)


@pytest.mark.parametrize("hold_s", [0.0, 2.0])
def test_goal_times_increase(hold_s: float) -> None:
    """Times increase also without a rest and for a resting arm, since controllers refuse two points at one time."""
    way = joint_way()
    path = replace(way, samples=(*way.samples, way.samples[-1]), hold_s=hold_s)
    for goal in (each["trajectory"] for each in YAML(typ="safe", pure=True).load_all(write_goals(path))):
        times = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in goal["points"]]
        assert np.all(np.diff(times) > 0)
        assert times[-1] == pytest.approx(path.arrivals_s[-1] + hold_s)
        assert len(times) == (len(way.samples) if hold_s == 0 else 2 * len(path.samples) - 1)


def test_goals_need_joints() -> None:
    """A trajectory consists of joints, so poses are refused."""
    with pytest.raises(InputError, match="joints are unknown"):
        write_goals(pose_way())


def moves(text: str) -> list[tuple[str, list[float]]]:
    """Return whether each `movej` has a pose, and its numbers."""
    found = re.findall(r"movej\((p?)\[([^\]]*)\], a=[\d.]+, v=0\.5\)", text)
    return [(kind, [float(number) for number in numbers.split(",")]) for kind, numbers in found]


def test_ur_script_moves_in_order() -> None:
    """Each sample has a move, a rest and a dialog. The program starts its function, and is for one arm."""
    text = write_ur_script(joint_way("eye"))
    assert np.allclose([numbers for _, numbers in moves(text)], planned_joints(joint_way(), "eye"), atol=1e-6)
    assert text.count("sleep(2)") == text.count("blocking=True") == 3
    assert text.startswith("def basecal_eye():")
    assert text.rstrip().endswith("end\nbasecal_eye()")
    with pytest.raises(InputError, match="--robot"):
        write_ur_script(joint_way())


def test_ur_script_poses_are_rotation_vectors() -> None:
    """Poses are of the flange in the base, with the tool set to the flange."""
    way = pose_way()
    text = write_ur_script(way)
    assert "set_tcp(p[0, 0, 0, 0, 0, 0])" in text
    for (kind, numbers), sample in zip(moves(text), way.samples, strict=True):
        apart = way.pose("hand", sample).inverse() @ SE3.from_rotvec(np.array(numbers[3:]), np.array(numbers[:3]))
        assert kind == "p"
        assert np.abs(apart.log()).max() < 1e-6


def test_ur_script_counts_samples() -> None:
    """Samples are counted from one beside their numbers, in the order of the path."""
    text = write_ur_script(joint_way("hand"))
    assert re.findall(r"textmsg\(.basecal: (.*?).\)", text) == [f"sample {19 + k}, {k} of 3" for k in (1, 2, 3)]
    assert re.findall(r"popup\(.(sample .*?): take", text) == [f"sample {19 + k}, {k} of 3" for k in (1, 2, 3)]
