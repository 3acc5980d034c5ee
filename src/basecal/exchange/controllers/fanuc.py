"""FANUC: X, Y, Z, W, P, R in mm and degrees, W, P and R about the fixed axes x, y, z.

Source: docs.baslerweb.com, rc_visard, "FANUC XYZ-WPR format": Rz(R) Ry(P) Rx(W).
"""

from basecal.exchange.controllers.convention import DEGREE, FIXED_XYZ, MILLIMETRE, Convention

CONVENTION = Convention(("X", "Y", "Z", "W", "P", "R"), MILLIMETRE, DEGREE, FIXED_XYZ)
