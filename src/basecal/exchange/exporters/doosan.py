"""A pose as Doosan's DRL says it: `posx(x, y, z, a, b, c)` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.doosan import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers

EXPORTER = pasted_numbers(
    "posx(x, y, z, a, b, c) of DRL in mm and deg",
    CONVENTION,
    "#",
    "mm and deg, about z, the new y, the new z",
    lambda numbers: [f"posx({', '.join(numbers)})"],
)
