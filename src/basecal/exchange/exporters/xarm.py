"""A pose as the Python SDK of UFACTORY's xArm says it: `[x, y, z, roll, pitch, yaw]` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.xarm import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Lists of Python, each below its comment."""
    lines = comments(request.remarks, "#")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and deg")], "#")
        lines.append(f"[{', '.join(written_numbers(CONVENTION, one.estimate))}]")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("[x, y, z, roll, pitch, yaw] in mm and deg", export_text, is_pasted=True)
