"""A row for each sample: joints of each robot that has any [rad], and the pose of its flange in its base."""

from __future__ import annotations

from basecal.exchange.exports.quoting import csv_row
from basecal.exchange.motions.way import Motion, Way

_POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")


def write_motion(way: Way) -> str:
    """A line of names, then the rows."""
    head = ["sample"]
    for name in way.robots:
        joints = way.joint_names(name) if way.has_joints(name) else ()
        head += [f"{name}_{column}" for column in (*(f"{joint}_rad" for joint in joints), *_POSE)]
    rows = [csv_row(head)]
    for sample in way.samples:
        row = [str(sample.sample)]
        for name in way.robots:
            joints_rad = sample.robots[name].joints_rad
            pose = way.pose(name, sample)
            numbers = [*(() if joints_rad is None else joints_rad), *pose.translation, *pose.quaternion]
            row += [f"{float(number):.9g}" for number in numbers]
        rows.append(",".join(row))
    return "\n".join(rows) + "\n"


MOTION = Motion("a row for each sample: joints, and poses of the flanges", write_motion)
