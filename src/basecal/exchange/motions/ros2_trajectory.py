"""Goals of `control_msgs/action/FollowJointTrajectory` as YAML, one document for each robot.

All robots take the same time for each way, so that goals that are sent together stay in step. They stand still at each
sample from its time for as long as the plan holds.
"""

from __future__ import annotations

from basecal.exchange.exports.quoting import yaml_word
from basecal.exchange.motions.way import Motion, Way


def write_motion(way: Way) -> str:
    """The documents.

    Raises:
        InputError: if a robot is known by poses alone.
    """
    return "".join(f"---\n# {name}\n{_goal(way, name)}" for name in way.robots)


def _goal(way: Way, robot: str) -> str:
    names = way.joint_names(robot)
    lines = ["trajectory:", f"  joint_names: [{', '.join(map(yaml_word, names))}]", "  points:"]
    still = ", ".join(["0.0"] * len(names))
    for number, joints, arrival_s in zip(way.numbers, way.joints(robot), way.arrivals_s, strict=True):
        positions = ", ".join(f"{float(joint):.9g}" for joint in joints)
        for at_s in (arrival_s, arrival_s + way.hold_s):
            seconds, nanoseconds = divmod(round(1e9 * at_s), 1_000_000_000)
            lines += [
                f"  - positions: [{positions}] # sample {number}",
                f"    velocities: [{still}]",
                f"    time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}",
            ]
    return "\n".join(lines) + "\n"


MOTION = Motion(
    "goals of FollowJointTrajectory as YAML, one document for each robot, in step with one another", write_motion
)
