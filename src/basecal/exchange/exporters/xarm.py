"""A pose as the Python SDK of UFACTORY's xArm says it: `[x, y, z, roll, pitch, yaw]` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.xarm import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import Wanted


def exported(wanted: Wanted) -> str:
    """Lists of Python, each below its comment."""
    lines = comments(wanted.remarks, "#")
    for one in wanted.transforms:
        lines += comments([about(one, "mm and deg")], "#")
        lines.append(f"[{', '.join(written_numbers(CONVENTION, one.estimate))}]")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("[x, y, z, roll, pitch, yaw] in mm and deg", exported, is_pasted=True)
