"""Registry of the kinds of targets, and the type of any target's entry in `cell.yaml`.

A new kind needs a module, a name and a line here.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, Literal

from pydantic import Discriminator, GetPydanticSchema, Tag

from basecal.cell.targets import aprilgrid, apriltag, charuco, chessboard, circles, led, points
from basecal.cell.targets.kind import TargetEntry, TargetKind

TargetKindName = Literal[
    "charuco",
    "chessboard",
    "circles",
    "apriltag",
    "aprilgrid",
    "points",
    "led",
]
"""Names of the kinds, for type checkers."""

TARGETS: Mapping[str, TargetKind] = {
    "charuco": charuco.KIND,
    "chessboard": chessboard.KIND,
    "circles": circles.KIND,
    "apriltag": apriltag.KIND,
    "aprilgrid": aprilgrid.KIND,
    "points": points.KIND,
    "led": led.KIND,
}
"""Kinds of targets by name."""


def entry_with_tag(tag: str) -> type[TargetEntry] | None:
    """Model of the entry with a tag of the union; None for an unknown tag."""
    return _entries().get(tag)


@cache
def _entries() -> dict[str, type[TargetEntry]]:
    """Models of entries by tag; tags are in angle brackets, to distinguish them from field names in errors."""
    entries = [TargetEntry]
    for kind in TARGETS.values():
        entries += kind.entries
    return {_tag(entry): entry for entry in entries}


def _tag(entry: type[TargetEntry]) -> str:
    return f"<{entry.__name__}>"


def _entry_tag(data: Any) -> str:
    """Tag of the model that reads an entry."""
    name = data.get("kind") if isinstance(data, dict) else None
    if name is None:
        return _tag(TargetEntry)
    if not isinstance(name, str) or name not in TARGETS:
        return "<unknown>"
    kind = TARGETS[name]
    return _tag(kind.entries[kind.entry_index(data)])


def _union() -> Any:
    tagged = [Annotated[entry, Tag(tag)] for tag, entry in _entries().items()]
    return Annotated[reduce(or_, tagged), Discriminator(_entry_tag)]


AnyTargetEntry = Annotated[TargetEntry, GetPydanticSchema(lambda _, handler: handler.generate_schema(_union()))]
