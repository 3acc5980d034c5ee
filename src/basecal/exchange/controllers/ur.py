"""Universal Robots: `p[x, y, z, rx, ry, rz]` in metres, and the rotation vector in radians.

Source: The URScript Programming Language, "Module urmath", `rotvec2rpy`, `pose_trans`.
"""

from basecal.exchange.controllers.convention import METRE, RADIAN, ROTATION_VECTOR, Convention

CONVENTION = Convention(("x", "y", "z", "rx", "ry", "rz"), METRE, RADIAN, ROTATION_VECTOR)
