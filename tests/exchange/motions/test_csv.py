"""A table of a plan."""

from __future__ import annotations

import csv
import io

import numpy as np

from basecal.exchange.motions.csv import write_motion
from shared.motion_ways import joints_of, of_joints, of_poses


def test_rows_are_samples() -> None:
    """Joints of both arms and poses of their flanges, which agree by the arms' kinematics."""
    way = of_joints()
    rows = list(csv.DictReader(io.StringIO(write_motion(way))))
    assert [int(row["sample"]) for row in rows] == [20, 21, 22]
    for robot in way.robots:
        joints = np.array([[float(row[f"{robot}_{name}_rad"]) for name in way.joint_names(robot)] for row in rows])
        assert np.allclose(joints, joints_of(way, robot), atol=1e-8)
        placed = [[float(row[f"{robot}_{axis}_m"]) for axis in "xyz"] for row in rows]
        assert np.allclose(placed, [way.pose(robot, sample).translation for sample in way.samples], atol=1e-8)


def test_a_robot_of_poses_has_poses_alone() -> None:
    """No column of joints, and a unit quaternion."""
    rows = list(csv.DictReader(io.StringIO(write_motion(of_poses()))))
    assert list(rows[0]) == ["sample", *(f"hand_{name}" for name in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"))]
    quaternion = [float(rows[1][f"hand_q{axis}"]) for axis in "xyzw"]
    assert abs(np.linalg.norm(quaternion) - 1) < 1e-8
