"""KUKA: `{X, Y, Z, A, B, C}` in mm and degrees, A about z, B about the new y, C about the new x.

Source: KUKA System Software, Operating and Programming Instructions, "Coordinate systems", rotation angles of the robot
coordinate systems; docs.baslerweb.com, rc_visard, "KUKA XYZ-ABC format".
"""

from basecal.exchange.controllers.convention import DEGREE, MILLIMETRE, MOVING_ZYX, Convention

CONVENTION = Convention(("X", "Y", "Z", "A", "B", "C"), MILLIMETRE, DEGREE, MOVING_ZYX)
