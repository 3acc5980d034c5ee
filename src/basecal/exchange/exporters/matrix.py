"""A 4x4 matrix, a row on a line, as NumPy's `loadtxt` and `basecal import poses` read it."""

from __future__ import annotations

from basecal.exchange.exports.digits import format_decimals, length_decimals, unit_decimals
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Matrices one below the other."""
    lines = comments(request.remarks, "#")
    for one in request.transforms:
        turned = [format_decimals(row, unit_decimals(one.estimate)) for row in one.estimate.mean.rotation]
        places = format_decimals(one.estimate.mean.translation, length_decimals(one.estimate, 1.0))
        rows = [" ".join([*row, place]) for row, place in zip(turned, places, strict=True)]
        lines += [*comments([describe_transform(one, "m")], "#"), *rows, "0 0 0 1"]
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("4x4 matrix, a row on a line", export_text, is_pasted=True)
