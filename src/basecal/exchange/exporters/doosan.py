"""A pose as Doosan's DRL says it: `posx(x, y, z, a, b, c)` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.doosan import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import Wanted


def exported(wanted: Wanted) -> str:
    """Poses of DRL, each below its comment."""
    lines = comments(wanted.remarks, "#")
    for one in wanted.transforms:
        lines += comments([about(one, "mm and deg, about z, the new y, the new z")], "#")
        lines.append(f"posx({', '.join(written_numbers(CONVENTION, one.estimate))})")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("posx(x, y, z, a, b, c) of DRL in mm and deg", exported, is_pasted=True)
