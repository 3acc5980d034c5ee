"""A frame as VAL 3 says it: `{x, y, z, rx, ry, rz}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.staubli import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers

EXPORTER = pasted_numbers(
    "{x, y, z, rx, ry, rz} of VAL 3 in mm and deg",
    CONVENTION,
    "//",
    "mm and deg, about x, the new y, the new z",
    lambda numbers: ["{" + ", ".join(numbers) + "}"],
)
