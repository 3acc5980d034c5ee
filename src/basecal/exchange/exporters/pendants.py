"""Export of poses in the notation of pendants and controllers' programs, such as KRL frames and RAPID poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import format_decimals, length_decimals, written_numbers
from basecal.exchange.exports.exporter import Exporter, NamedTransform, Wanted, comments, describe_transform

_LONGEST_NAME = 32
"""Largest number of characters of an identifier. Source: RAPID Overview, "Identifiers"."""


def pasted_lines(
    words: str, mark: str, units: str, lines_of: Callable[[NamedTransform, Wanted], list[str]]
) -> Exporter:
    """Create an exporter of transforms as lines to paste.

    Args:
        words: Description of the format for help.
        mark: Start of a comment.
        units: Units of the numbers, in words.
        lines_of: Function from a transform and the request to lines.
    """

    def text(request: Wanted) -> str:
        """Format the remarks, then each transform below its description."""
        lines = comments(request.remarks, mark)
        for one in request.transforms:
            lines += comments([describe_transform(one, units)], mark) + lines_of(one, request)
        return "\n".join(lines) + "\n"

    return Exporter(words, text, is_pasted=True)


def _pendant(controller: str, words: str, mark: str, units: str, form: str) -> Exporter:
    """Create an exporter of a controller's numbers, inserted into a template `form` of one or more lines."""

    def numbers(one: NamedTransform, request: Wanted) -> list[str]:
        """Format the lines of a transform."""
        return form.format(*written_numbers(CONTROLLERS[controller], one.estimate)).splitlines()

    return pasted_lines(words, mark, units, numbers)


def frame_lines(one: NamedTransform, request: Wanted) -> list[str]:
    """Format a KRL frame, also as `$BASE`, `$ROBROOT` or `$TOOL` if applicable, with explanations.

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


def pose_lines(one: NamedTransform, request: Wanted) -> list[str]:
    """Format a RAPID pose, in a base also as a work object, and for a base as the Base Frame of system parameters.

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


PENDANTS: Mapping[str, Exporter] = {
    "ur": _pendant(
        "ur",
        "p[...] of URScript, m and rotation vector",
        "#",
        "m and rotation vector in rad",
        "p[{}, {}, {}, {}, {}, {}]",
    ),
    "kuka": pasted_lines(
        "{X, Y, Z, A, B, C} of KRL in mm and deg, with $BASE, $ROBROOT or $TOOL", ";", "mm and deg", frame_lines
    ),
    "abb": pasted_lines(
        "pose of RAPID in mm, quaternion w first, with wobjdata and Base Frame",
        "!",
        "mm and quaternion, scalar first",
        pose_lines,
    ),
    # Format of positions in a listing (.LS).
    "fanuc": _pendant(
        "fanuc",
        "X, Y, Z, W, P, R in mm and deg",
        "!",
        "mm and deg",
        "X = {} mm, Y = {} mm, Z = {} mm,\nW = {} deg, P = {} deg, R = {} deg",
    ),
    # With names, and in the order of a user frame.
    "yaskawa": _pendant(
        "yaskawa",
        "X, Y, Z, Rx, Ry, Rz in mm and deg, and the line of UFRAME.CND",
        "'",
        "mm and deg",
        "X {0}, Y {1}, Z {2}, Rx {3}, Ry {4}, Rz {5}\n////BUSER {0},{1},{2},{3},{4},{5}",
    ),
    "staubli": _pendant(
        "staubli",
        "{x, y, z, rx, ry, rz} of VAL 3 in mm and deg",
        "//",
        "mm and deg, about x, the new y, the new z",
        "{{{}, {}, {}, {}, {}, {}}}",
    ),
    "denso": _pendant(
        "denso", "P(X, Y, Z, RX, RY, RZ) of PacScript in mm and deg", "'", "mm and deg", "P({}, {}, {}, {}, {}, {})"
    ),
    "doosan": _pendant(
        "doosan",
        "posx(x, y, z, a, b, c) of DRL in mm and deg",
        "#",
        "mm and deg, about z, the new y, the new z",
        "posx({}, {}, {}, {}, {}, {})",
    ),
    "xarm": _pendant(
        "xarm", "[x, y, z, roll, pitch, yaw] in mm and deg", "#", "mm and deg", "[{}, {}, {}, {}, {}, {}]"
    ),
}
"""Exporters by the controller's name."""
