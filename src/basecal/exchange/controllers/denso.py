"""DENSO: X, Y, Z, RX, RY, RZ in mm and degrees, the angles about the fixed axes x, y, z.

Source: DENSO RC8 manual, "Position Data", for the units; doc.percipio.xyz, RVS, adapter generator, for the order: DENSO
among X-Y-Z of static axes.
"""

from basecal.exchange.controllers.convention import DEGREE, FIXED_XYZ, MILLIMETRE, Convention

CONVENTION = Convention(("X", "Y", "Z", "RX", "RY", "RZ"), MILLIMETRE, DEGREE, FIXED_XYZ)
