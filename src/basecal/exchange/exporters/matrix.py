"""A 4x4 matrix, a row on a line, as NumPy's `loadtxt` and `basecal import poses` read it."""

from __future__ import annotations

from basecal.exchange.exporters.exporter import Takes
from basecal.exchange.exports.digits import fixed, length_decimals, unit_decimals
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import NamedTransform, Wanted

TAKES: tuple[Takes, ...] = ("transform",)
PASTED = True


def exported(wanted: Wanted) -> str:
    """Matrices one below the other."""
    lines = comments(wanted.remarks, "#")
    for one in wanted.transforms:
        lines += [*comments([about(one, "m")], "#"), *_rows(one)]
    return "\n".join(lines) + "\n"


def _rows(one: NamedTransform) -> list[str]:
    mean, length, unit = one.estimate.mean, length_decimals(one.estimate, 1.0), unit_decimals(one.estimate)
    turned = [fixed(row, unit) for row in mean.rotation]
    places = fixed(mean.translation, length)
    return [*(" ".join([*row, place]) for row, place in zip(turned, places, strict=True)), "0 0 0 1"]
