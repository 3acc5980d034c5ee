"""Transforms that `tf2_echo` of ROS 2 and `tf_echo` of ROS 1 print, as rows of x, y, z, qx, qy, qz, qw."""

from __future__ import annotations

import re

_TRANSLATION = re.compile(r"-? *Translation: *\[([^\]]*)\]")
_ROTATION = re.compile(r"-? *Rotation: in Quaternion[^\[]*\[([^\]]*)\]")


def transform_rows(text: str) -> str:
    """A row for each transform, in the line of its rotation; other lines are empty. Empty if it is another text."""
    rows, place = [], ""
    for line in map(str.strip, text.splitlines()):
        translation, rotation = _TRANSLATION.match(line), _ROTATION.match(line)
        rows.append(f"{place}, {rotation[1]}" if rotation and place else "")
        place = translation[1] if translation else "" if rotation else place
    return "\n".join(rows) if any(rows) else ""
