"""A pose as DENSO's controllers say it: X, Y, Z in mm, RX, RY, RZ in degrees."""

from __future__ import annotations

from basecal.exchange.controllers.denso import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers

EXPORTER = pasted_numbers(
    "P(X, Y, Z, RX, RY, RZ) of PacScript in mm and deg",
    CONVENTION,
    "'",
    "mm and deg",
    lambda numbers: [f"P({', '.join(numbers)})"],
)
