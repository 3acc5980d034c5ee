"""Every kind of target: a new one is a module, a name and a line here; and the entry in `cell.yaml` of any of them."""

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
"""The names of the table, for what checks them."""

TARGETS: Mapping[str, TargetKind] = {
    "charuco": charuco.KIND,
    "chessboard": chessboard.KIND,
    "circles": circles.KIND,
    "apriltag": apriltag.KIND,
    "aprilgrid": aprilgrid.KIND,
    "points": points.KIND,
    "led": led.KIND,
}
"""All that is particular to a kind of target, by its name."""


def entry_with_tag(tag: str) -> type[TargetEntry] | None:
    """The model of an entry by the tag it has in a union; None for the tag of no kind."""
    return _entries().get(tag)


@cache
def _entries() -> dict[str, type[TargetEntry]]:
    """Models of entries by tag; in angle brackets, so that no error mistakes a tag for a field."""
    entries = [TargetEntry]
    for kind in TARGETS.values():
        entries += kind.entries
    return {_tag(entry): entry for entry in entries}


def _tag(entry: type[TargetEntry]) -> str:
    return f"<{entry.__name__}>"


def _entry_tag(data: Any) -> str:
    """Which model reads an entry."""
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
