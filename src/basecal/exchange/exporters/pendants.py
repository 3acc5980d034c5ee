"""Export of poses in the notation of pendants and controllers' programs, such as KRL frames and RAPID poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import format_decimals, format_pose, length_decimals
from basecal.exchange.exports.exporter import Exporter, ExportRequest, NamedTransform, comments, describe_transform

_LONGEST_NAME = 32
"""Largest number of characters of an identifier. Source: RAPID Overview, "Identifiers"."""


def line_exporter(
    words: str, mark: str, units: str, format_lines: Callable[[NamedTransform, ExportRequest], list[str]]
) -> Exporter:
    """Create an exporter of transforms as lines to paste.

    Args:
        words: Description of the format for help.
        mark: Start of a comment.
        units: Units of the numbers, in words.
        format_lines: Function from a transform and the request to lines.
    """

    def text(request: ExportRequest) -> str:
        """Format the remarks, then each transform below its description."""
        lines = comments(request.remarks, mark)
        for transform in request.transforms:
            lines += comments([describe_transform(transform, units)], mark) + format_lines(transform, request)
        return "\n".join(lines) + "\n"

    return Exporter(words, text, is_pasted=True)


def _pendant_exporter(controller: str, words: str, mark: str, units: str, template: str) -> Exporter:
    """Create an exporter of a controller's numbers, inserted into a template of one or more lines."""

    def numbers(transform: NamedTransform, request: ExportRequest) -> list[str]:
        """Format the lines of a transform."""
        return template.format(*format_pose(CONTROLLERS[controller], transform.estimate)).splitlines()

    return line_exporter(words, mark, units, numbers)


def krl_frame_lines(transform: NamedTransform, request: ExportRequest) -> list[str]:
    """Format a KRL frame, also as `$BASE`, `$ROBROOT` or `$TOOL` if applicable, with explanations.

    Source: KUKA System Variables: `$BASE` and `$ROBROOT` are in WORLD, `$TOOL` is in the flange.
    """
    numbers = zip("XYZABC", format_pose(CONTROLLERS["kuka"], transform.estimate), strict=True)
    frame = "{" + ", ".join(f"{name} {number}" for name, number in numbers) + "}"
    lines = [frame]
    parent, child = transform.own_frames
    if parent.endswith("_flange"):
        lines.append(f"$TOOL={frame} ; on {parent.removesuffix('_flange')}: poses are then those of {child}")
    elif parent.endswith("_base"):
        robot = parent.removesuffix("_base")
        lines.append(f"$BASE={frame} ; on {robot}, its $ROBROOT zero: poses are then in {child}")
        other = child.removesuffix("_base")
        if child.endswith("_base") and request.may_have_controller(other, "kuka"):
            lines.append(f"$ROBROOT={frame} ; on {other}: its WORLD is then {parent}")
    return lines


def rapid_pose_lines(transform: NamedTransform, request: ExportRequest) -> list[str]:
    """Format a RAPID pose, in a base also as a work object, and for a base as the Base Frame of system parameters.

    Work objects are fixed in the world, base frames in metres. Source: RAPID Reference Manual, data type `wobjdata`;
    System parameters, topic Motion, type Robot, "Base Frame".
    """
    numbers = format_pose(CONTROLLERS["abb"], transform.estimate)
    pose = f"[[{','.join(numbers[:3])}],[{','.join(numbers[3:])}]]"
    parent, child = transform.own_frames
    if not parent.endswith("_base"):
        return [pose]
    name = f"wobj_{child}"[:_LONGEST_NAME]
    lines = [pose, f'PERS wobjdata {name}:=[FALSE,TRUE,"",{pose},[[0,0,0],[1,0,0,0]]];']
    other = child.removesuffix("_base")
    if child.endswith("_base") and request.may_have_controller(other, "abb"):
        metres = format_decimals(transform.estimate.mean.translation, length_decimals(transform.estimate, 1.0))
        frame = ", ".join(f"{key} {value}" for key, value in zip("xyz", metres, strict=True))
        quaternion = ", ".join(f"q{i} {value}" for i, value in enumerate(numbers[3:], start=1))
        lines += comments([f"Base Frame of {other}, where the world is {parent}: {frame} [m], {quaternion}"], "!")
    return lines


PENDANTS: Mapping[str, Exporter] = {
    "ur": _pendant_exporter(
        "ur",
        "p[...] of URScript, m and rotation vector",
        "#",
        "m and rotation vector in rad",
        "p[{}, {}, {}, {}, {}, {}]",
    ),
    "kuka": line_exporter(
        "{X, Y, Z, A, B, C} of KRL in mm and deg, with $BASE, $ROBROOT or $TOOL", ";", "mm and deg", krl_frame_lines
    ),
    "abb": line_exporter(
        "pose of RAPID in mm, quaternion w first, with wobjdata and Base Frame",
        "!",
        "mm and quaternion, scalar first",
        rapid_pose_lines,
    ),
    # Format of positions in a listing (.LS).
    "fanuc": _pendant_exporter(
        "fanuc",
        "X, Y, Z, W, P, R in mm and deg",
        "!",
        "mm and deg",
        "X = {} mm, Y = {} mm, Z = {} mm,\nW = {} deg, P = {} deg, R = {} deg",
    ),
    # With names, and in the order of a user frame.
    "yaskawa": _pendant_exporter(
        "yaskawa",
        "X, Y, Z, Rx, Ry, Rz in mm and deg, and the line of UFRAME.CND",
        "'",
        "mm and deg",
        "X {0}, Y {1}, Z {2}, Rx {3}, Ry {4}, Rz {5}\n////BUSER {0},{1},{2},{3},{4},{5}",
    ),
    "staubli": _pendant_exporter(
        "staubli",
        "{x, y, z, rx, ry, rz} of VAL 3 in mm and deg",
        "//",
        "mm and deg, about x, the new y, the new z",
        "{{{}, {}, {}, {}, {}, {}}}",
    ),
    "denso": _pendant_exporter(
        "denso", "P(X, Y, Z, RX, RY, RZ) of PacScript in mm and deg", "'", "mm and deg", "P({}, {}, {}, {}, {}, {})"
    ),
    "doosan": _pendant_exporter(
        "doosan",
        "posx(x, y, z, a, b, c) of DRL in mm and deg",
        "#",
        "mm and deg, about z, the new y, the new z",
        "posx({}, {}, {}, {}, {}, {})",
    ),
    "xarm": _pendant_exporter(
        "xarm", "[x, y, z, roll, pitch, yaw] in mm and deg", "#", "mm and deg", "[{}, {}, {}, {}, {}, {}]"
    ),
}
"""Exporters by the controller's name."""
