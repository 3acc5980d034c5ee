"""A frame as VAL 3 says it: `{x, y, z, rx, ry, rz}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.staubli import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Values of type `trsf`, each below its comment."""
    lines = comments(request.remarks, "//")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and deg, about x, the new y, the new z")], "//")
        lines.append("{" + ", ".join(written_numbers(CONVENTION, one.estimate)) + "}")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("{x, y, z, rx, ry, rz} of VAL 3 in mm and deg", export_text, is_pasted=True)
