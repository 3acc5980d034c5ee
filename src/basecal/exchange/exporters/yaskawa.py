"""A pose as Yaskawa's pendants and UFRAME.CND say it: X, Y, Z in mm, Rx, Ry, Rz in degrees."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.exchange.controllers.yaskawa import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers


def _lines(numbers: Sequence[str]) -> list[str]:
    """The numbers by their names, and in the order of a user frame."""
    named = (f"{name} {number}" for name, number in zip(CONVENTION.names, numbers, strict=True))
    return [", ".join(named), f"////BUSER {','.join(numbers)}"]


EXPORTER = pasted_numbers(
    "X, Y, Z, Rx, Ry, Rz in mm and deg, and the line of UFRAME.CND", CONVENTION, "'", "mm and deg", _lines
)
