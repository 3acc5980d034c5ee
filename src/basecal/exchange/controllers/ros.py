"""ROS: x, y, z in metres and the quaternion qx, qy, qz, qw, as in `geometry_msgs/Pose` and TUM's trajectories.

Source: REP 103, and the definition of geometry_msgs/Quaternion.
"""

from basecal.exchange.controllers.convention import METRE, QUATERNION_XYZW, RADIAN, Convention

CONVENTION = Convention(("x", "y", "z", "qx", "qy", "qz", "qw"), METRE, RADIAN, QUATERNION_XYZW)
