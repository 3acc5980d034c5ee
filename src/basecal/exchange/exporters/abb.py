"""A pose as RAPID says it, the quaternion with its scalar first, mm; and the work object or base frame of it."""

from __future__ import annotations

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import format_decimals, length_decimals, written_numbers
from basecal.exchange.exports.pasted_lines import pasted_lines
from basecal.exchange.exports.remarks import comments
from basecal.exchange.exports.wanted import NamedTransform, Wanted

_LONGEST_NAME = 32
"""Characters of an identifier. Source: RAPID Overview, "Identifiers"."""


def pose_lines(one: NamedTransform, request: Wanted) -> list[str]:
    """A pose of RAPID; what is in a base is a work object too, and a base the Base Frame of the robot's parameters.

    Work objects are fixed in the world, base frames in metres. Source: RAPID Reference Manual, data type `wobjdata`;
    System parameters, topic Motion, type Robot, "Base Frame".
    """
    numbers = written_numbers(CONTROLLERS["abb"], one.estimate)
    pose = f"[[{','.join(numbers[:3])}],[{','.join(numbers[3:])}]]"
    parent, child = one.own_frames
    if not parent.endswith("_base"):
        return [pose]
    name = f"wobj_{child}"[:_LONGEST_NAME]
    lines = [pose, f'PERS wobjdata {name}:=[FALSE,TRUE,"",{pose},[[0,0,0],[1,0,0,0]]];']
    other = child.removesuffix("_base")
    if child.endswith("_base") and request.may_have_controller(other, "abb"):
        metres = format_decimals(one.estimate.mean.translation, length_decimals(one.estimate, 1.0))
        frame = ", ".join(f"{key} {value}" for key, value in zip("xyz", metres, strict=True))
        turned = ", ".join(f"q{i} {value}" for i, value in enumerate(numbers[3:], start=1))
        lines += comments([f"Base Frame of {other}, where the world is {parent}: {frame} [m], {turned}"], "!")
    return lines


EXPORTER = pasted_lines(
    "pose of RAPID in mm, quaternion w first, with wobjdata and Base Frame",
    "!",
    "mm and quaternion, scalar first",
    pose_lines,
)
