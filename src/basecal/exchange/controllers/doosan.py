"""Doosan: `posx(x, y, z, a, b, c)` in mm and degrees, about z, the new y, the new z.

Source: docs.vathos.net, "Rotations": Doosan ZYZ of moving axes.
"""

from basecal.exchange.controllers.convention import DEGREE, MILLIMETRE, MOVING_ZYZ, Convention

CONVENTION = Convention(("x", "y", "z", "a", "b", "c"), MILLIMETRE, DEGREE, MOVING_ZYZ)
