"""A frame as VAL 3 says it: `{x, y, z, rx, ry, rz}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.staubli import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import Wanted


def exported(wanted: Wanted) -> str:
    """Values of type `trsf`, each below its comment."""
    lines = comments(wanted.remarks, "//")
    for one in wanted.transforms:
        lines += comments([about(one, "mm and deg, about x, the new y, the new z")], "//")
        lines.append("{" + ", ".join(written_numbers(CONVENTION, one.estimate)) + "}")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("{x, y, z, rx, ry, rz} of VAL 3 in mm and deg", exported, is_pasted=True)
