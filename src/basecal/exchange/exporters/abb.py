"""A pose as RAPID says it, the quaternion with its scalar first, mm; and the work object or base frame of it."""

from __future__ import annotations

from basecal.exchange.controllers.abb import CONVENTION
from basecal.exchange.exports.digits import format_decimals, length_decimals, written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted

_LONGEST_NAME = 32
"""Characters of an identifier. Source: RAPID Overview, "Identifiers"."""


def export_text(request: Wanted) -> str:
    """Poses of RAPID; what is in a base is a work object too, and a base the Base Frame of the robot's parameters.

    Work objects are fixed in the world, base frames in metres. Source: RAPID Reference Manual, data type `wobjdata`;
    System parameters, topic Motion, type Robot, "Base Frame".
    """
    lines = comments(request.remarks, "!")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and quaternion, scalar first")], "!")
        numbers = written_numbers(CONVENTION, one.estimate)
        pose = f"[[{','.join(numbers[:3])}],[{','.join(numbers[3:])}]]"
        lines.append(pose)
        parent, child = one.own_frames
        if not parent.endswith("_base"):
            continue
        name = f"wobj_{child}"[:_LONGEST_NAME]
        lines.append(f'PERS wobjdata {name}:=[FALSE,TRUE,"",{pose},[[0,0,0],[1,0,0,0]]];')
        other = child.removesuffix("_base")
        if child.endswith("_base") and request.may_have_controller(other, "abb"):
            metres = format_decimals(one.estimate.mean.translation, length_decimals(one.estimate, 1.0))
            frame = ", ".join(f"{key} {value}" for key, value in zip("xyz", metres, strict=True))
            turned = ", ".join(f"q{i} {value}" for i, value in enumerate(numbers[3:], start=1))
            said = f"Base Frame of {other}, where the world is {parent}: {frame} [m], {turned}"
            lines += comments([said], "!")
    return "\n".join(lines) + "\n"


EXPORTER = Exporter(
    "pose of RAPID in mm, quaternion w first, with wobjdata and Base Frame", export_text, is_pasted=True
)
