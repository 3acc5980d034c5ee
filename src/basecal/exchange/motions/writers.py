"""Output formats of plans: CSV table, joints as JSON, goals of ROS 2, and URScript program."""

from __future__ import annotations

import json
from collections.abc import Mapping

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.exporter import csv_row, yaml_word
from basecal.exchange.motions.way import PlanFormat, RobotPath

_POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
_ACCELERATION = 0.5  # [rad/s^2], a third of the arms' default


def write_table(path: RobotPath) -> str:
    """Format a path as CSV with a header: the joints [rad] and the flange pose of each robot per sample.

    Joints are left out for a robot that has some samples without them.
    """
    head = ["sample"]
    for name in path.robots:
        joints = path.joint_names(name) if path.has_joints(name) else ()
        head += [f"{name}_{column}" for column in (*(f"{joint}_rad" for joint in joints), *_POSE)]
    rows = [csv_row(head)]
    for sample in path.samples:
        row = [str(sample.sample)]
        for name in path.robots:
            joints_rad = sample.robots[name].joints_rad if path.has_joints(name) else None
            pose = path.pose(name, sample)
            numbers = [*(() if joints_rad is None else joints_rad), *pose.translation, *pose.quaternion]
            row += [f"{float(number):.9g}" for number in numbers]
        rows.append(",".join(row))
    return "\n".join(rows) + "\n"


def write_joints(path: RobotPath) -> str:
    """Format a path as a JSON object with the numbers of the samples and the joints of each robot [rad].

    Raises:
        InputError: if a robot is planned with poses.
    """
    robots = {
        name: {"joint_names": list(path.joint_names(name)), "joints_rad": path.joints(name).tolist()}
        for name in path.robots
    }
    return json.dumps({"samples": path.numbers, "robots": robots}, indent=1) + "\n"


def write_goals(path: RobotPath) -> str:
    """Format a path as goals of `control_msgs/action/FollowJointTrajectory` in YAML, one document per robot.

    All robots arrive at the same times, so that goals sent together stay synchronized. They rest at each sample for the
    plan's hold time.

    Raises:
        InputError: if a robot is planned with poses.
    """
    return "".join(f"---\n# {name}\n{_goal(path, name)}" for name in path.robots)


def _goal(path: RobotPath, robot: str) -> str:
    names = path.joint_names(robot)
    lines = ["trajectory:", f"  joint_names: [{', '.join(map(yaml_word, names))}]", "  points:"]
    still, last_ns = ", ".join(["0.0"] * len(names)), -1
    for number, joints, arrival_s in zip(path.numbers, path.joints(robot), path.arrivals_s, strict=True):
        positions = ", ".join(f"{float(joint):.9g}" for joint in joints)
        for at_s in (arrival_s, arrival_s + path.hold_s):
            at_ns = round(1e9 * at_s)
            if at_ns <= last_ns:  # controllers refuse times that do not increase
                continue
            last_ns = at_ns
            seconds, nanoseconds = divmod(at_ns, 1_000_000_000)
            lines += [
                f"  - positions: [{positions}] # sample {number}",
                f"    velocities: [{still}]",
                f"    time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}",
            ]
    return "\n".join(lines) + "\n"


def write_ur_script(path: RobotPath) -> str:
    """Format a path as a URScript program for one arm, which waits for the operator at each sample.

    `movej` takes joints [rad], or a flange pose, for which the controller computes the joints. In the second case
    the tool must be the flange, which `set_tcp` ensures.

    Raises:
        InputError: if the path has several robots.
    """
    robot = path.single_robot()
    lines = [f"def basecal_{robot}():", "  set_tcp(p[0, 0, 0, 0, 0, 0])"]
    for position, sample in enumerate(path.samples, start=1):
        joints = sample.robots[robot].joints_rad
        numbers = CONTROLLERS["ur"].to_numbers(path.pose(robot, sample)) if joints is None else joints
        target = f"{'p' if joints is None else ''}[{', '.join(f'{float(number):.6f}' for number in numbers)}]"
        what = f"sample {sample.sample}, {position} of {len(path.samples)}"
        lines += [
            f'  textmsg("basecal: {what}")',
            f"  movej({target}, a={_ACCELERATION:g}, v={path.speed_rad_s:.4g})",
            f"  sleep({path.hold_s:g})",
            f'  popup("{what}: take the image, then continue", title="basecal", blocking=True)',
        ]
    return "\n".join([*lines, "end", f"basecal_{robot}()"]) + "\n"


PLAN_FORMATS: Mapping[str, PlanFormat] = {
    "joints": PlanFormat("joints of all robots as JSON [rad]", write_joints),
    "ur-script": PlanFormat("with --robot: a program of URScript that waits at each sample", write_ur_script),
    "ros2-trajectory": PlanFormat(
        "goals of FollowJointTrajectory as YAML, one document for each robot, in step with one another", write_goals
    ),
    "csv": PlanFormat("a row for each sample: joints, and poses of the flanges", write_table),
}
"""Output formats of plans by their name in `basecal plan --to`; a new format needs a function and a line here."""
