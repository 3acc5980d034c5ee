"""UFACTORY xArm: x, y, z, roll, pitch, yaw in mm and degrees, about the fixed axes x, y, z.

Source: UFACTORY Lite 6 User Manual, page 95: Rz(yaw) Ry(pitch) Rx(roll).
"""

from basecal.exchange.controllers.convention import DEGREE, FIXED_XYZ, MILLIMETRE, Convention

CONVENTION = Convention(("x", "y", "z", "roll", "pitch", "yaw"), MILLIMETRE, DEGREE, FIXED_XYZ)
