"""A pose as URScript says it, to paste where a pose is requested: `p[x, y, z, rx, ry, rz]`."""

from __future__ import annotations

from basecal.exchange.controllers.ur import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Poses of URScript, each on a line below its comment."""
    lines = comments(request.remarks, "#")
    for one in request.transforms:
        lines += comments([describe_transform(one, "m and rotation vector in rad")], "#")
        lines.append(f"p[{', '.join(written_numbers(CONVENTION, one.estimate))}]")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("p[...] of URScript, m and rotation vector", export_text, is_pasted=True)
