"""Hand-written YAML: plain data, and the line number of each key."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent
from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
from ruamel.yaml.parser import Parser

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, error_words
from basecal.fields.problems import CAUSE_LENGTH, Loc, Problem, dataset_error, shorten

LARGEST_BYTES = 2**19
"""Largest YAML file [bytes]: 512 kB, twenty times a cell with a target of a thousand tags; parsed in seconds."""

_DEEPEST = 32  # levels: a cell has six, and the recursion limit is much higher
_WIDTH = 4096  # characters before a line is broken: a matrix stays on one
_CONVERTED = {f"tag:yaml.org,2002:{kind}" for kind in ("int", "float", "bool", "null")}
# Messages of the parser that are translated to their usual cause. A bracket or quote is reported where it was opened.
_BRACKET = "expected ',' or '"
_QUOTE = "while scanning a quoted scalar"
_UNEXPECTED_KEYS = ("mapping values are not allowed here", "expected '<document start>'")
_UNEXPECTED_ENTRY = "expected <block end>, but found '<block mapping start>'"
_UNEXPECTED_BRACKET = re.compile(r"but found '([]}])'")
_NO_TOKEN = re.compile(r"found character '(.)' that cannot start any token", re.DOTALL)

_TAB = re.compile(r"^ *\t")
_NO_SPACE = re.compile(r"^\s*[A-Za-z_]\w*:[^\s:]")


@dataclass(frozen=True)
class Document:
    """Content of a YAML file: mappings with text keys, lists and scalars; `lines` by location, from 1."""

    data: Any
    lines: Mapping[Loc, int]


@dataclass(frozen=True)
class _Notes:
    constructor: Any
    lines: dict[Loc, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


def read_text(path: Path, missing: str, largest: int = LARGEST_BYTES) -> str:
    """Read the text of a UTF-8 file.

    Args:
        path: The file.
        missing: Advice for the error if the file does not exist.
        largest: Largest allowed size [bytes].

    Raises:
        DatasetError: if the file cannot be read, is larger or is not UTF-8.
    """
    try:
        return read_bounded(path, largest, missing).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError(str(path), f"not UTF-8 text (byte {error.start}); save it as UTF-8") from None


class _NotPlain(Exception):
    """A node that is not plain data.

    Attributes:
        reason: The problem and its fix.
        line: Line of the node, from 1.
    """

    def __init__(self, reason: str, event: Any) -> None:
        super().__init__(reason)
        self.reason, self.line = reason, event.start_mark.line + 1


class _PlainParser(Parser):
    """Parser that rejects aliases, anchors, tags and nesting deeper than `_DEEPEST`."""

    _depth = 0

    def get_event(self) -> Any:
        """Return the next event.

        Raises:
            _NotPlain: if the event is not plain data.
        """
        event = super().get_event()
        self._depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if self._depth > _DEEPEST:
            raise _NotPlain(f"nested deeper than {_DEEPEST} levels, which no cell needs", event)
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None:
            raise _NotPlain("aliases and anchors (* and &) are not allowed; write the value out", event)
        # The event of a document's start has a `tags` dictionary; only a text is a tag.
        if isinstance(getattr(event, "tag", None), str):
            raise _NotPlain(f"tags ({event.tag[:_DEEPEST]}) are not allowed; write the plain value", event)
        return event


def _format(path: str) -> str:
    """Format according to the file's name; JSON is parsed as YAML."""
    return "JSON" if path.lower().endswith((".json", ".jsonl")) else "YAML"


def parse_yaml(text: str, path: str) -> Document:
    """Parse a YAML 1.2 document into plain data and the lines of its keys.

    Raises:
        DatasetError: if it is not YAML, has an alias, an anchor, a tag or a duplicate key, or is nested too deeply.
    """
    yaml = _yaml()
    yaml.Parser = _PlainParser
    try:
        node = yaml.compose(text)
    except _NotPlain as error:
        raise DatasetError(path, error.reason, error.line) from None
    except MarkedYAMLError as error:
        fault = yaml_fault(text, error)
        raise DatasetError(path, f"not {_format(path)}: {fault.reason}", fault.line) from None
    except (YAMLError, ValueError) as error:
        raise DatasetError(path, f"not {_format(path)}: {error_words(error)[:CAUSE_LENGTH]}") from None
    notes = _Notes(_yaml().constructor)
    data = None if node is None else _plain(node, (), notes)
    if notes.problems:
        raise dataset_error(path, notes.problems, notes.lines)
    return Document(data, notes.lines)


def yaml_text(data: Any) -> str:
    """Format plain data as YAML: one line per innermost mapping or list, keys in their given order."""
    return _dump(data, None)


def yaml_entry(name: str, value: Any) -> str:
    """Format an entry of a mapping on one line: `name: {status: prior, sigma_m: 0.01}`."""
    return _dump({name: value}, True).strip()[1:-1]


def _dump(data: Any, is_flow: bool | None) -> str:
    yaml = _yaml()
    yaml.default_flow_style = is_flow
    yaml.sort_base_mapping_type_on_output = False
    yaml.allow_unicode = True
    yaml.width = _WIDTH
    yaml.representer.ignore_aliases = lambda *_: True
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()


def _yaml() -> Any:
    return YAML(typ="safe", pure=True)


def _plain(node: Any, loc: Loc, notes: _Notes) -> Any:
    notes.lines.setdefault(loc, node.start_mark.line + 1)
    if isinstance(node, MappingNode):
        return _mapping(node, loc, notes)
    if isinstance(node, SequenceNode):
        return [_plain(item, (*loc, index), notes) for index, item in enumerate(node.value)]
    if node.tag not in _CONVERTED:
        return node.value
    try:
        return notes.constructor.construct_object(node)
    except (ValueError, OverflowError, YAMLError):
        notes.problems.append(Problem(loc, f"{shorten(node.value)} is not a number that can be read"))
        return None


def _mapping(node: Any, loc: Loc, notes: _Notes) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key, value in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, ScalarNode):
            notes.problems.append(Problem(loc, f"a key on line {line} is not a name; write `name: value`"))
            continue
        name = str(key.value)
        location = (*loc, name)
        if name in data:
            first = notes.lines[location]
            notes.lines[location] = line
            notes.problems.append(Problem(location, f"given twice, first on line {first}; keep one"))
        notes.lines.setdefault(location, line)
        data[name] = _plain(value, location, notes)
    return data


class Fault(NamedTuple):
    """A syntax error and its line, from 1."""

    reason: str
    line: int | None


def yaml_fault(text: str, error: MarkedYAMLError) -> Fault:
    """Translate a parser's error to its likely cause and line."""
    message, mark, start_mark = str(error.problem or error.context), error.problem_mark, error.context_mark
    line = mark.line + 1 if mark else None
    lines = text.splitlines()
    tab = next((number for number, text_of_line in enumerate(lines, start=1) if _TAB.match(text_of_line)), None)
    if tab is not None:
        return Fault("this line is indented with a tab, which YAML does not allow: use spaces", tab)
    if message.startswith(_BRACKET) and start_mark:
        expected = message[len(_BRACKET)]
        return Fault(f"the bracket that opens here is not closed: add {expected}", start_mark.line + 1)
    if error.context == _QUOTE and start_mark:
        return Fault("the quote that opens here is not closed: add another", start_mark.line + 1)
    if message.startswith(_UNEXPECTED_KEYS) and line is not None:
        if line > len(lines):
            return Fault("the file ends without content: expected `key: value`", len(lines))
        return _key_fault(lines, line)
    if message == _UNEXPECTED_ENTRY:
        return Fault("this line is indented unlike its neighbours: indent all entries of a list equally", line)
    if match := _UNEXPECTED_BRACKET.search(message):
        return Fault(f"a closing bracket {match[1]} has no opening bracket: remove it", line)
    if match := _NO_TOKEN.search(message):
        return Fault(f"a value cannot start with {match[1]!r}: put it in quotes", line)
    return Fault(" ".join(message.split()), line)


def _key_fault(lines: list[str], line: int) -> Fault:
    """Fault for a key where the parser expected a value."""
    above = next((number for number in range(line - 1, 0, -1) if _content(lines[number - 1])), None)
    for number in (above, line):
        if number is not None and _NO_SPACE.match(lines[number - 1]):
            return Fault("a space after the colon is missing: write `key: value`", number)
    if above is not None and ":" not in _content(lines[above - 1]):
        return Fault("expected `key: value`, there is no colon", above)
    if _content(lines[line - 1]).count(": ") > 1:
        return Fault("two colons: put a value that holds one in quotes", line)
    return Fault("this line is indented under a line that already has a value: indent it like that line", line)


def _content(line: str) -> str:
    return line.partition("#")[0].strip()
