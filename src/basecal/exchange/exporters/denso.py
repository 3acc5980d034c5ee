"""A pose as DENSO's controllers say it: X, Y, Z in mm, RX, RY, RZ in degrees."""

from __future__ import annotations

from basecal.exchange.controllers.denso import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Positions of PacScript, each below its comment; the figure is not said, since it is none of a frame's."""
    lines = comments(request.remarks, "'")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and deg")], "'")
        lines.append(f"P({', '.join(written_numbers(CONVENTION, one.estimate))})")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("P(X, Y, Z, RX, RY, RZ) of PacScript in mm and deg", export_text, is_pasted=True)
