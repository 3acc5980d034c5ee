"""A frame as KRL says it, and the lines that set it: `{X, Y, Z, A, B, C}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.pasted_lines import pasted_lines
from basecal.exchange.exports.wanted import NamedTransform, Wanted


def frame_lines(one: NamedTransform, request: Wanted) -> list[str]:
    """A frame of KRL; `$BASE`, `$ROBROOT` or `$TOOL` where the transform is one, with what is then meant.

    Source: KUKA System Variables: `$BASE` and `$ROBROOT` are in WORLD, `$TOOL` is in the flange.
    """
    numbers = zip("XYZABC", written_numbers(CONTROLLERS["kuka"], one.estimate), strict=True)
    frame = "{" + ", ".join(f"{name} {number}" for name, number in numbers) + "}"
    lines = [frame]
    parent, child = one.own_frames
    if parent.endswith("_flange"):
        lines.append(f"$TOOL={frame} ; on {parent.removesuffix('_flange')}: poses are then those of {child}")
    elif parent.endswith("_base"):
        robot = parent.removesuffix("_base")
        lines.append(f"$BASE={frame} ; on {robot}, its $ROBROOT zero: poses are then in {child}")
        other = child.removesuffix("_base")
        if child.endswith("_base") and request.may_have_controller(other, "kuka"):
            lines.append(f"$ROBROOT={frame} ; on {other}: its WORLD is then {parent}")
    return lines


EXPORTER = pasted_lines(
    "{X, Y, Z, A, B, C} of KRL in mm and deg, with $BASE, $ROBROOT or $TOOL", ";", "mm and deg", frame_lines
)
