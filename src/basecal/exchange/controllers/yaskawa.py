"""Yaskawa (Motoman): X, Y, Z, Rx, Ry, Rz in mm and degrees, the angles about the fixed axes x, y, z.

Source: docs.baslerweb.com, rc_cube, "Yaskawa Pose Format": Rz(Rz) Ry(Ry) Rx(Rx).
"""

from basecal.exchange.controllers.convention import DEGREE, FIXED_XYZ, MILLIMETRE, Convention

CONVENTION = Convention(("X", "Y", "Z", "Rx", "Ry", "Rz"), MILLIMETRE, DEGREE, FIXED_XYZ)
