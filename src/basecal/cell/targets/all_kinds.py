"""The kinds of targets that are registered, and the entry in `cell.yaml` that may be of any of them."""

from __future__ import annotations

from functools import cache, reduce
from importlib import import_module
from operator import or_
from typing import Annotated, Any, get_args

from pydantic import Discriminator, GetPydanticSchema, Tag

from basecal.cell.targets.kind import TargetEntry, TargetKind
from basecal.registry import TargetKindName

KIND_NAMES: tuple[TargetKindName, ...] = get_args(TargetKindName)


@cache
def target_kind(name: TargetKindName) -> TargetKind:
    """All that is particular to a kind of target."""
    kind: TargetKind = import_module(f"basecal.cell.targets.{name}").KIND
    return kind


def entry_with_tag(tag: str) -> type[TargetEntry] | None:
    """The model of an entry by the tag it has in a union; None for the tag of no kind."""
    return _entries().get(tag)


@cache
def _entries() -> dict[str, type[TargetEntry]]:
    """Models of entries by tag; in angle brackets, so that no error mistakes a tag for a field."""
    entries = [TargetEntry]
    for name in KIND_NAMES:
        entries += target_kind(name).entries
    return {_tag(entry): entry for entry in entries}


def _tag(entry: type[TargetEntry]) -> str:
    return f"<{entry.__name__}>"


def _tag_of(data: Any) -> str:
    """Which model reads an entry."""
    name = data.get("kind") if isinstance(data, dict) else None
    if name is None:
        return _tag(TargetEntry)
    if name not in KIND_NAMES:
        return "<unknown>"
    kind = target_kind(name)
    return _tag(kind.entries[kind.entry_index(data)])


def _union() -> Any:
    tagged = [Annotated[entry, Tag(tag)] for tag, entry in _entries().items()]
    return Annotated[reduce(or_, tagged), Discriminator(_tag_of)]


AnyTargetEntry = Annotated[TargetEntry, GetPydanticSchema(lambda _, handler: handler.generate_schema(_union()))]
