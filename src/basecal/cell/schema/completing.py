"""Additions to the text of a `cell.yaml` that keep its formatting, comments and order."""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from basecal.cell.format.yaml_text import parse_yaml, yaml_text
from basecal.cell.schema.cell_schema import SCHEMA
from basecal.errors import DatasetError
from basecal.fields.problems import SHORT_LENGTH, Loc, field_name, shorten

_WIDTH = 4096  # characters before a line is broken: longer than any hand-written line


def completed_cell_text(
    text: str | None, additions: Mapping[str, Any], path: str, replacements: Collection[Loc] = ()
) -> tuple[str, tuple[str, ...]]:
    """Add data to the text of a `cell.yaml`; return the new text and the names of the changed fields.

    Args:
        text: Existing `cell.yaml`; None to create one from `additions` and the schema.
        additions: Plain data of a `cell.yaml`; fields that already have the same value are not changed.
        path: Name of the file in errors.
        replacements: Locations whose existing value may be replaced.

    Raises:
        DatasetError: if the text is not YAML, or has a different value at a location that may not be replaced.
    """
    if text is None:
        data = {"schema": SCHEMA, **additions}
        return yaml_text(data), tuple(key for key in data if key != "schema")
    lines = parse_yaml(text, path).lines
    yaml = YAML(typ="rt", pure=True)
    yaml.width, yaml.preserve_quotes = _WIDTH, True
    data = yaml.load(text)
    if not isinstance(data, dict):
        raise DatasetError(path, f"expected a mapping that starts with `schema: {SCHEMA}`, got {shorten(data)}")
    changed: list[Loc] = []
    for loc, value in _merge_additions(data, additions, (), frozenset(replacements), changed):
        message = f"is {_value_text(value[0])}, but {_value_text(value[1])} in the imported data: correct the wrong one"
        raise DatasetError(path, message, lines.get(loc), field_name(loc))
    if not changed:
        return text, ()
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue(), tuple(map(field_name, changed))


def _merge_additions(
    data: dict[str, Any], additions: Mapping[str, Any], parent: Loc, replacements: frozenset[Loc], changes: list[Loc]
) -> list[tuple[Loc, tuple[Any, Any]]]:
    """Merge additions into `data` and list the changes in `changes`; return the locations of conflicting values."""
    conflicts = []
    for key, value in additions.items():
        loc = (*parent, key)
        if (loc in replacements and data.get(key) != value) or data.get(key) is None:
            data[key] = _flow_style(value)
            changes.append(loc)
        elif isinstance(value, Mapping) and isinstance(data[key], dict):
            conflicts += _merge_additions(data[key], value, loc, replacements, changes)
        elif data[key] != value:
            conflicts.append((loc, (data[key], value)))
    return conflicts


def _flow_style(value: Any) -> Any:
    """Value with YAML flow style: one line per innermost mapping or list."""
    if isinstance(value, Mapping):
        inner = {key: _flow_style(each) for key, each in value.items()}
        mapping = CommentedMap(inner)
        if not any(isinstance(each, Mapping) for each in inner.values()):
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, list | tuple):
        sequence = CommentedSeq([_flow_style(each) for each in value])
        sequence.fa.set_flow_style()
        return sequence
    return value


def _value_text(value: Any) -> str:
    text = str(list(value) if isinstance(value, list) else value)
    return text if len(text) <= SHORT_LENGTH else shorten(value)
