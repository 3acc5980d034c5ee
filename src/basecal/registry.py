"""What can be chosen by name, a line each; all else about it stands in the module of that name.

It names and imports nothing, so that the command line can list choices without loading them.
"""

from __future__ import annotations

from typing import Literal

TargetKindName = Literal[
    "charuco",
    "chessboard",
    "circles",
    "apriltag",
    "aprilgrid",
    "points",
    "led",
]
"""Kinds of targets: modules of `basecal.cell.targets`."""

LENSES = (
    "pinhole",
    "fisheye",
    "thin_prism",
)
"""Lenses: modules of `basecal.geometry.lenses`; several may be one model with other numbers of terms."""

CONTROLLERS = (
    "ur",
    "kuka",
    "abb",
    "fanuc",
    "yaskawa",
    "staubli",
    "denso",
    "franka",
    "doosan",
    "xarm",
    "ros",
    "matrix",
)
"""Robots' controllers whose way to write poses is known: modules of `basecal.exchange.controllers`."""

EXPORTERS = {
    "ur": "p[...] of URScript, m and rotation vector",
    "kuka": "{X, Y, Z, A, B, C} of KRL in mm and deg, with $BASE, $ROBROOT or $TOOL",
    "abb": "pose of RAPID in mm, quaternion w first, with wobjdata and Base Frame",
    "fanuc": "X, Y, Z, W, P, R in mm and deg",
    "yaskawa": "X, Y, Z, Rx, Ry, Rz in mm and deg, and the line of UFRAME.CND",
    "staubli": "{x, y, z, rx, ry, rz} of VAL 3 in mm and deg",
    "denso": "P(X, Y, Z, RX, RY, RZ) of PacScript in mm and deg",
    "doosan": "posx(x, y, z, a, b, c) of DRL in mm and deg",
    "xarm": "[x, y, z, roll, pitch, yaw] in mm and deg",
    "ros": "geometry_msgs/PoseWithCovarianceStamped as YAML",
    "ros2": "launch file that publishes on /tf_static",
    "matrix": "4x4 matrix, a row on a line",
    "json": "all digits and the covariance",
    "csv": "a row for each transform",
    "opencv": "FileStorage in YAML of transforms, or with --camera of its lens",
    "camera_info": "with --camera: its lens as a calibration file of ROS",
    "usd": "frames of a USD stage, as text (.usda); needs the extra `usd`",
    "mujoco": "bodies of an MJCF model",
    "urdf": "with --robot: its URDF with its joint offsets and link errors in the origins of its joints",
    "urdf_joint": "with --urdf FILE: that URDF, the origin of a fixed joint in it being what was found",
    "urdf_cell": "one URDF of all robots, each where it was found; with --urdf FILE... from these",
}
"""Kinds of `basecal export` with what each gives: modules of `basecal.exchange.exporters`."""

DRIVERS = (
    "simulated",
    "replay",
    "folder",
    "typed",
    "opencv",
    "ur",
    "opcua",
    "ros2",
)
"""What talks to robots and cameras: modules of `basecal.acquisition.drivers`; others come as entry points."""

PATTERNS = {
    "poses": "both arms turn about the target, as far as they reach",
    "shifts": "from stations, the target is shifted along its axes before a still camera",
}
"""Where arms can be sent by a plan, and what it does: modules of `basecal.planning`."""

MOTIONS = {
    "joints": "joints of all robots as JSON [rad]",
    "ur-script": "with --robot: a program of URScript that waits at each sample",
    "ros2-trajectory": "goals of FollowJointTrajectory as YAML, one document for each robot, in step with one another",
    "csv": "a row for each sample: joints, and poses of the flanges",
}
"""Ways to write where a plan sends the arms: modules of `basecal.exchange.motions`, with `_` for `-`."""

SOLVERS = {
    "maximum_likelihood": "all at once, as `basecal.solve`",
    "closed_form": "the paper's, of a light shifted before a still camera",
    "opencv": "solvePnP, then calibrateRobotWorldHandEye",
}
"""What a study may solve with: modules of `basecal.studies.solvers`."""
