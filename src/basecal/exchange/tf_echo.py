"""Conversion of the output of `tf2_echo` (ROS 2) and `tf_echo` (ROS 1) to rows of x, y, z, qx, qy, qz, qw."""

from __future__ import annotations

import re

_TRANSLATION = re.compile(r"-? *Translation: *\[([^\]]*)\]")
_ROTATION = re.compile(r"-? *Rotation: in Quaternion[^\[]*\[([^\]]*)\]")


def transform_rows(text: str) -> str:
    """Convert each transform to a row on the line of its rotation; other lines are empty. Empty for other texts."""
    rows, position = [], ""
    for line in map(str.strip, text.splitlines()):
        translation, rotation = _TRANSLATION.match(line), _ROTATION.match(line)
        rows.append(f"{position}, {rotation[1]}" if rotation and position else "")
        position = translation[1] if translation else "" if rotation else position
    return "\n".join(rows) if any(rows) else ""
