"""A frame as KRL says it, and the lines that set it: `{X, Y, Z, A, B, C}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.kuka import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Frames of KRL; `$BASE`, `$ROBROOT` or `$TOOL` where the transform is one, with what is then meant.

    Source: KUKA System Variables: `$BASE` and `$ROBROOT` are in WORLD, `$TOOL` is in the flange.
    """
    lines = comments(request.remarks, ";")
    for one in request.transforms:
        numbers = zip(CONVENTION.names, written_numbers(CONVENTION, one.estimate), strict=True)
        frame = "{" + ", ".join(f"{name} {number}" for name, number in numbers) + "}"
        lines += [*comments([describe_transform(one, "mm and deg")], ";"), frame]
        parent, child = one.own_frames
        if parent.endswith("_flange"):
            lines.append(f"$TOOL={frame} ; on {parent.removesuffix('_flange')}: poses are then those of {child}")
        elif parent.endswith("_base"):
            robot = parent.removesuffix("_base")
            lines.append(f"$BASE={frame} ; on {robot}, its $ROBROOT zero: poses are then in {child}")
            other = child.removesuffix("_base")
            if child.endswith("_base") and request.may_have_controller(other, "kuka"):
                lines.append(f"$ROBROOT={frame} ; on {other}: its WORLD is then {parent}")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter(
    "{X, Y, Z, A, B, C} of KRL in mm and deg, with $BASE, $ROBROOT or $TOOL", export_text, is_pasted=True
)
