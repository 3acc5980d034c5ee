"""A transform as a URDF says it: metres, and angles about the fixed axes x, y, z."""

from __future__ import annotations

from collections.abc import Iterable

from basecal.geometry import SE3


def numbers(values: Iterable[float], digits: int = 9) -> str:
    """Numbers to paste: fixed point, a space between, no negative zero."""
    return " ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)


def origin_line(parent_from_child: SE3) -> str:
    """The `<origin>` of the joint that holds the child's frame in the parent's."""
    return f'<origin xyz="{numbers(parent_from_child.translation)}" rpy="{numbers(parent_from_child.rpy)}"/>'
