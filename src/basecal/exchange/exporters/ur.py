"""A pose as URScript says it, to paste where a pose is requested: `p[x, y, z, rx, ry, rz]`."""

from __future__ import annotations

from basecal.exchange.controllers.ur import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers

EXPORTER = pasted_numbers(
    "p[...] of URScript, m and rotation vector",
    CONVENTION,
    "#",
    "m and rotation vector in rad",
    lambda numbers: [f"p[{', '.join(numbers)}]"],
)
