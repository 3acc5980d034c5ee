"""Export of 4x4 matrices, one row per line, readable by NumPy's `loadtxt` and `basecal import poses`."""

from __future__ import annotations

from basecal.exchange.exporters.pendants import pasted_lines
from basecal.exchange.exports.digits import format_decimals, length_decimals, unit_decimals
from basecal.exchange.exports.exporter import NamedTransform, Wanted


def matrix_lines(one: NamedTransform, request: Wanted) -> list[str]:
    """Format the rows of a transform's matrix."""
    turned = [format_decimals(row, unit_decimals(one.estimate)) for row in one.estimate.mean.rotation]
    places = format_decimals(one.estimate.mean.translation, length_decimals(one.estimate, 1.0))
    return [*(" ".join([*row, place]) for row, place in zip(turned, places, strict=True)), "0 0 0 1"]


EXPORTER = pasted_lines("4x4 matrix, a row on a line", "#", "m", matrix_lines)
