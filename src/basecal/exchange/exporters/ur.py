"""A pose as URScript says it, to paste where a pose is asked for: `p[x, y, z, rx, ry, rz]`."""

from __future__ import annotations

from basecal.exchange.controllers.ur import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import Wanted


def exported(wanted: Wanted) -> str:
    """Poses of URScript, each on a line below its comment."""
    lines = comments(wanted.remarks, "#")
    for one in wanted.transforms:
        lines += comments([about(one, "m and rotation vector in rad")], "#")
        lines.append(f"p[{', '.join(written_numbers(CONVENTION, one.estimate))}]")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("p[...] of URScript, m and rotation vector", exported, is_pasted=True)
