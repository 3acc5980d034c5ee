"""Stäubli: x, y, z, rx, ry, rz in mm and degrees, about x, the new y, the new z.

Source: github.com/visose/Robots, SystemStaubli; compas.dev, tutorial "Frames"; docs.baslerweb.com,
rc_visard, "Pose formats" on the names of orders.
"""

from basecal.exchange.controllers.convention import DEGREE, MILLIMETRE, MOVING_XYZ, Convention

CONVENTION = Convention(("x", "y", "z", "rx", "ry", "rz"), MILLIMETRE, DEGREE, MOVING_XYZ)
