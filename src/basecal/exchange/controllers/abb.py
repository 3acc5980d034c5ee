"""ABB: `[[x, y, z], [q1, q2, q3, q4]]` in mm, the quaternion with its scalar first.

Source: RAPID Reference Manual, data types `pose` and `orient`.
"""

from basecal.exchange.controllers.convention import MILLIMETRE, QUATERNION_WXYZ, RADIAN, Convention

CONVENTION = Convention(("x", "y", "z", "q1", "q2", "q3", "q4"), MILLIMETRE, RADIAN, QUATERNION_WXYZ)
