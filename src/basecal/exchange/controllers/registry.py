"""Registry of controllers' pose conventions; a new controller needs an entry here with its source."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.controllers.convention import (
    DEGREE,
    FIXED_XYZ,
    METRE,
    MILLIMETRE,
    MOVING_XYZ,
    MOVING_ZYX,
    MOVING_ZYZ,
    QUATERNION_WXYZ,
    QUATERNION_XYZW,
    RADIAN,
    ROTATION_VECTOR,
    AnyConvention,
    Convention,
    MatrixConvention,
)

CONTROLLERS: Mapping[str, AnyConvention] = {
    # Universal Robots: The URScript Programming Language, "Module urmath", `rotvec2rpy`, `pose_trans`.
    "ur": Convention(("x", "y", "z", "rx", "ry", "rz"), METRE, RADIAN, ROTATION_VECTOR),
    # KUKA System Software, Operating and Programming Instructions, "Coordinate systems", rotation angles of the robot
    # coordinate systems; docs.baslerweb.com, rc_visard, "KUKA XYZ-ABC format".
    "kuka": Convention(("X", "Y", "Z", "A", "B", "C"), MILLIMETRE, DEGREE, MOVING_ZYX),
    # ABB: RAPID Reference Manual, data types `pose` and `orient`.
    "abb": Convention(("x", "y", "z", "q1", "q2", "q3", "q4"), MILLIMETRE, RADIAN, QUATERNION_WXYZ),
    # FANUC: docs.baslerweb.com, rc_visard, "FANUC XYZ-WPR format": Rz(R) Ry(P) Rx(W).
    "fanuc": Convention(("X", "Y", "Z", "W", "P", "R"), MILLIMETRE, DEGREE, FIXED_XYZ),
    # Yaskawa (Motoman): docs.baslerweb.com, rc_cube, "Yaskawa Pose Format": Rz(Rz) Ry(Ry) Rx(Rx).
    "yaskawa": Convention(("X", "Y", "Z", "Rx", "Ry", "Rz"), MILLIMETRE, DEGREE, FIXED_XYZ),
    # Stäubli: github.com/visose/Robots, SystemStaubli; compas.dev, tutorial "Frames"; docs.baslerweb.com, rc_visard,
    # "Pose formats" on the names of orders.
    "staubli": Convention(("x", "y", "z", "rx", "ry", "rz"), MILLIMETRE, DEGREE, MOVING_XYZ),
    # DENSO RC8 manual, "Position Data", for the units; doc.percipio.xyz, RVS, adapter generator, for the order: DENSO
    # among X-Y-Z of static axes.
    "denso": Convention(("X", "Y", "Z", "RX", "RY", "RZ"), MILLIMETRE, DEGREE, FIXED_XYZ),
    # Franka: libfranka, `franka::RobotState::O_T_EE`: "4x4 matrix in column-major format"; its example
    # generate_cartesian_pose_motion.cpp moves along x by the number at 12. The output of echo_robot_state in its
    # "Getting started" is the pose of the hand at the joints printed with it.
    "franka": MatrixConvention(tuple(f"O_T_EE_{i}" for i in range(16)), METRE, is_by_columns=True),
    # Doosan: docs.vathos.net, "Rotations": Doosan ZYZ of moving axes.
    "doosan": Convention(("x", "y", "z", "a", "b", "c"), MILLIMETRE, DEGREE, MOVING_ZYZ),
    # UFACTORY Lite 6 User Manual, page 95: Rz(yaw) Ry(pitch) Rx(roll).
    "xarm": Convention(("x", "y", "z", "roll", "pitch", "yaw"), MILLIMETRE, DEGREE, FIXED_XYZ),
    # ROS: REP 103, and the definition of geometry_msgs/Quaternion; TUM's trajectories are the same.
    "ros": Convention(("x", "y", "z", "qx", "qy", "qz", "qw"), METRE, RADIAN, QUATERNION_XYZW),
    "matrix": MatrixConvention(tuple(f"m{i}{j}" for i in range(4) for j in range(4)), METRE, is_by_columns=False),
}
"""Conventions by the controller's name, in the order of the help text; `matrix` belongs to no manufacturer."""
