"""Parsing of lengths with units and of counts in options: 0.5mm, 5x7."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from basecal.errors import UsageError

_UNITS_M = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
_LENGTH = re.compile(r"\s*([0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([a-z]*)\s*")
_COUNTS = re.compile(r"\s*([0-9]{1,4})\s*[xX,]\s*([0-9]{1,4})\s*")


def length_m(text: str, option: str = "--tolerance", example: str = "0.5mm", suffix: str = "") -> float:
    """Parse the length of an option [m], or with the suffix "/s" the speed [m/s]; errors quote the example.

    Raises:
        UsageError: if the text is not a positive number with a unit of length.
    """
    is_text = isinstance(text, str) and text.endswith(suffix)
    match = _LENGTH.fullmatch(text.removesuffix(suffix)) if is_text else None
    unit = _UNITS_M.get(match[2]) if match else None
    length = float(match[1]) * unit if match and unit else 0.0
    if not (length > 0 and math.isfinite(length)):
        quantity = "speed" if suffix else "length"
        raise UsageError(f"{option} {text!r}: expected a {quantity} above zero with its unit, such as {example}")
    return length


def columns_rows(text: str, option: str) -> tuple[int, int]:
    """Parse the columns and rows of an option.

    Raises:
        UsageError: if the text is not two numbers.
    """
    match = _COUNTS.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise UsageError(f"{option} {text!r}: expected columns and rows, such as 5x7")
    return int(match[1]), int(match[2])


def parse_name_options(option: str, arguments: Iterable[str], form: str) -> dict[str, str]:
    """Parse arguments of the form `name=value` to values by name.

    Raises:
        UsageError: if an argument has another form, or a name occurs twice.
    """
    values: dict[str, str] = {}
    for each in arguments:
        name, _, value = each.partition("=")
        if not name or not value or name in values:
            raise UsageError(f"{option} {each}: {'given twice' if name in values else f'expected {form}'}")
        values[name] = value
    return values
