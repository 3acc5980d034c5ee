"""A frame as KRL says it, and the lines that set it: `{X, Y, Z, A, B, C}` in mm and degrees."""

from __future__ import annotations

from basecal.exchange.controllers.kuka import CONVENTION
from basecal.exchange.exporters.exporter import Takes
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.remarks import about, comments
from basecal.exchange.exports.wanted import NamedTransform, Wanted

TAKES: tuple[Takes, ...] = ("transform",)
PASTED = True


def exported(wanted: Wanted) -> str:
    """Frames of KRL; `$BASE`, `$ROBROOT` or `$TOOL` where the transform is one."""
    lines = comments(wanted.remarks, ";")
    for one in wanted.transforms:
        numbers = zip(CONVENTION.names, written_numbers(CONVENTION, one.estimate), strict=True)
        frame = "{" + ", ".join(f"{name} {number}" for name, number in numbers) + "}"
        lines += [*comments([about(one, "mm and deg")], ";"), frame, *_set(one, frame)]
    return "\n".join(lines) + "\n"


def _set(one: NamedTransform, frame: str) -> list[str]:
    """Lines that set a frame of the controller, with what they mean there.

    Source: KUKA System Variables: `$BASE` and `$ROBROOT` are in WORLD, `$TOOL` is in the flange.
    """
    parent, child = one.own_frames
    if parent.endswith("_flange"):
        return [f"$TOOL={frame} ; on {parent.removesuffix('_flange')}: poses are then those of {child}"]
    if not parent.endswith("_base"):
        return []
    lines = [f"$BASE={frame} ; on {parent.removesuffix('_base')}, its $ROBROOT zero: poses are then in {child}"]
    if child.endswith("_base"):
        lines.append(f"$ROBROOT={frame} ; on {child.removesuffix('_base')}: its WORLD is then {parent}")
    return lines
