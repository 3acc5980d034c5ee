"""Errors of a text that is no YAML, in words for its author."""

from __future__ import annotations

import re
from typing import NamedTuple

from ruamel.yaml.error import MarkedYAMLError

# What the parser says, and what it is most often for. A bracket or a quote is told where it was opened.
_BRACKET = "expected ',' or '"
_QUOTE = "while scanning a quoted scalar"
_UNEXPECTED_KEYS = ("mapping values are not allowed here", "expected '<document start>'")
_UNEXPECTED_ENTRY = "expected <block end>, but found '<block mapping start>'"
_UNEXPECTED_BRACKET = re.compile(r"but found '([]}])'")
_NO_TOKEN = re.compile(r"found character '(.)' that cannot start any token", re.DOTALL)

_TAB = re.compile(r"^ *\t")
_NO_SPACE = re.compile(r"^\s*[A-Za-z_]\w*:[^\s:]")


class Fault(NamedTuple):
    """An error, and its line, from 1."""

    reason: str
    line: int | None


def yaml_fault(text: str, error: MarkedYAMLError) -> Fault:
    """Where and what the fault is that a parser stumbled over."""
    said, mark, begun = str(error.problem or error.context), error.problem_mark, error.context_mark
    line = mark.line + 1 if mark else None
    lines = text.splitlines()
    tab = next((number for number, written in enumerate(lines, start=1) if _TAB.match(written)), None)
    if tab is not None:
        return Fault("a tab sets this line in, which YAML does not allow: replace it by spaces", tab)
    if said.startswith(_BRACKET) and begun:
        expected = said[len(_BRACKET)]
        return Fault(f"the bracket that opens here is not closed: add {expected}", begun.line + 1)
    if error.context == _QUOTE and begun:
        return Fault("the quote that opens here is not closed: add another", begun.line + 1)
    if said.startswith(_UNEXPECTED_KEYS) and line is not None:
        if line > len(lines):
            return Fault("it ends before anything is said: expected `key: value`", len(lines))
        return _key_fault(lines, line)
    if said == _UNEXPECTED_ENTRY:
        return Fault("this line is indented unlike those beside it: give entries of one list the same spaces", line)
    if found := _UNEXPECTED_BRACKET.search(said):
        return Fault(f"a bracket {found[1]} closes that nothing opened: remove it", line)
    if found := _NO_TOKEN.search(said):
        return Fault(f"a value cannot start with {found[1]!r}: put it into quotes", line)
    return Fault(" ".join(said.split()), line)


def _key_fault(lines: list[str], line: int) -> Fault:
    """A key stands where its own value, or that of the line before it, was expected."""
    above = next((number for number in range(line - 1, 0, -1) if _content(lines[number - 1])), None)
    for number in (above, line):
        if number is not None and _NO_SPACE.match(lines[number - 1]):
            return Fault("a space after the colon is missing: write `key: value`", number)
    if above is not None and ":" not in _content(lines[above - 1]):
        return Fault("expected `key: value`, there is no colon", above)
    if _content(lines[line - 1]).count(": ") > 1:
        return Fault("two colons: put a value that holds one into quotes", line)
    return Fault("this line is indented under a line that has its value already: set it in as the one above", line)


def _content(line: str) -> str:
    return line.partition("#")[0].strip()
