"""A length with its unit as it is typed, such as 0.5mm."""

from __future__ import annotations

import math
import re

from basecal.errors import InputError

_UNITS_M = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
_LENGTH = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([a-z]*)\s*")


def tolerance_m(text: str) -> float:
    """The length that an option states [m].

    Raises:
        InputError: if it is no positive number with a unit of length.
    """
    found = _LENGTH.fullmatch(text)
    unit = _UNITS_M.get(found[2]) if found else None
    length = float(found[1]) * unit if found and unit else 0.0
    if not (length > 0 and math.isfinite(length)):
        raise InputError(f"--tolerance {text!r}: expected a length above zero with its unit, such as 0.5mm")
    return length
