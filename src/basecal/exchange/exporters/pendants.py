"""Poses as pendants and programs of controllers take them: six numbers in one form for each."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.pasted_lines import pasted_lines
from basecal.exchange.exports.wanted import NamedTransform, Wanted


def _pendant(controller: str, words: str, mark: str, units: str, form: str) -> Exporter:
    """An exporter of a controller's numbers, put into a form of one line or more."""

    def numbers(one: NamedTransform, request: Wanted) -> list[str]:
        """The lines of a transform."""
        return form.format(*written_numbers(CONTROLLERS[controller], one.estimate)).splitlines()

    return pasted_lines(words, mark, units, numbers)


PENDANTS: Mapping[str, Exporter] = {
    "ur": _pendant(
        "ur",
        "p[...] of URScript, m and rotation vector",
        "#",
        "m and rotation vector in rad",
        "p[{}, {}, {}, {}, {}, {}]",
    ),
    # As in the positions of a listing (.LS).
    "fanuc": _pendant(
        "fanuc",
        "X, Y, Z, W, P, R in mm and deg",
        "!",
        "mm and deg",
        "X = {} mm, Y = {} mm, Z = {} mm,\nW = {} deg, P = {} deg, R = {} deg",
    ),
    # By their names, and in the order of a user frame.
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
