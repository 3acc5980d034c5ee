"""A pose as the Python SDK of UFACTORY's xArm says it: `[x, y, z, roll, pitch, yaw]` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.xarm import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers

EXPORTER = pasted_numbers(
    "[x, y, z, roll, pitch, yaw] in mm and deg",
    CONVENTION,
    "#",
    "mm and deg",
    lambda numbers: [f"[{', '.join(numbers)}]"],
)
