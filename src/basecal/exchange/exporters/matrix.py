"""A 4x4 matrix, a row on a line, as NumPy's `loadtxt` and `basecal import poses` read it."""

from __future__ import annotations

from basecal.exchange.exports.digits import fixed, length_decimals, unit_decimals
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import Wanted


def exported(wanted: Wanted) -> str:
    """Matrices one below the other."""
    lines = comments(wanted.remarks, "#")
    for one in wanted.transforms:
        turned = [fixed(row, unit_decimals(one.estimate)) for row in one.estimate.mean.rotation]
        places = fixed(one.estimate.mean.translation, length_decimals(one.estimate, 1.0))
        rows = [" ".join([*row, place]) for row, place in zip(turned, places, strict=True)]
        lines += [*comments([about(one, "m")], "#"), *rows, "0 0 0 1"]
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("4x4 matrix, a row on a line", exported, is_pasted=True)
