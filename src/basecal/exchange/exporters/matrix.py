"""Export of 4x4 matrices, one row per line, readable by NumPy's `loadtxt` and `basecal import poses`."""

from __future__ import annotations

from basecal.exchange.exporters.pendants import line_exporter
from basecal.exchange.exports.digits import format_decimals, length_decimals, unit_decimals
from basecal.exchange.exports.exporter import ExportRequest, NamedTransform


def matrix_lines(transform: NamedTransform, request: ExportRequest) -> list[str]:
    """Format the rows of a transform's matrix."""
    estimate = transform.estimate
    rotation = [format_decimals(row, unit_decimals(estimate)) for row in estimate.mean.rotation]
    translation = format_decimals(estimate.mean.translation, length_decimals(estimate, 1.0))
    return [*(" ".join([*row, length]) for row, length in zip(rotation, translation, strict=True)), "0 0 0 1"]


EXPORTER = line_exporter("4x4 matrix, a row on a line", "#", "m", matrix_lines)
