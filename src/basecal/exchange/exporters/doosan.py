"""A pose as Doosan's DRL says it: `posx(x, y, z, a, b, c)` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.doosan import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Poses of DRL, each below its comment."""
    lines = comments(request.remarks, "#")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and deg, about z, the new y, the new z")], "#")
        lines.append(f"posx({', '.join(written_numbers(CONVENTION, one.estimate))})")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("posx(x, y, z, a, b, c) of DRL in mm and deg", export_text, is_pasted=True)
