"""A pose as Yaskawa's pendants and UFRAME.CND say it: X, Y, Z in mm, Rx, Ry, Rz in degrees."""

from __future__ import annotations

from basecal.exchange.controllers.yaskawa import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """The numbers by their names, and in the order of a user frame."""
    lines = comments(request.remarks, "'")
    for one in request.transforms:
        numbers = written_numbers(CONVENTION, one.estimate)
        named = (f"{name} {number}" for name, number in zip(CONVENTION.names, numbers, strict=True))
        lines += [
            *comments([describe_transform(one, "mm and deg")], "'"),
            ", ".join(named),
            f"////BUSER {','.join(numbers)}",
        ]
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("X, Y, Z, Rx, Ry, Rz in mm and deg, and the line of UFRAME.CND", export_text, is_pasted=True)
