"""Franka: `O_T_EE`, 16 numbers of a 4x4 matrix column by column, in metres.

Source: libfranka, `franka::RobotState::O_T_EE`: "4x4 matrix in column-major format"; its example
generate_cartesian_pose_motion.cpp moves along x by the number at 12. The output of echo_robot_state in its "Getting
started" is the pose of the hand at the joints beside it.
"""

from basecal.exchange.controllers.convention import METRE, MatrixConvention

CONVENTION = MatrixConvention(tuple(f"O_T_EE_{i}" for i in range(16)), METRE, is_by_columns=True)
