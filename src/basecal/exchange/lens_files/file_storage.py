"""Reading of OpenCV's FileStorage (YAML, XML and JSON) as plain data.

Its YAML starts with the non-standard `%YAML:1.0` and tags matrices `!!opencv-matrix`. Its XML has one element per
field, and a matrix has rows, cols, dt and data. Source: OpenCV's modules/core/src/persistence*.cpp.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from basecal.cell.format.yaml_text import LARGEST_BYTES, read_text
from basecal.errors import DatasetError
from basecal.exchange.fields import Field, parse_fields
from basecal.fields.problems import CAUSE_LENGTH

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_YAML_HEADER = re.compile(r"\A%YAML[: ][^\n]*")
_TAG = re.compile(r"!!(opencv|python)[-\w/.:]*")
_COMMENTS = re.compile(r"/\*.*?\*/|^[ \t]*//[^\n]*", re.S | re.M)  # allowed in OpenCV's JSON
_DEEPEST = 32  # levels, the same limit as for YAML


def read_file_storage(path: str | Path) -> Field:
    """Read a file written by OpenCV's FileStorage.

    Raises:
        DatasetError: if the file cannot be read.
    """
    text, name = read_text(Path(path), "", LARGEST_BYTES), str(path)
    start = text.lstrip()[:1]
    if start == "<":
        return _xml(text, name)
    if start == "{":
        text = _COMMENTS.sub(lambda comment: "\n" * comment[0].count("\n"), text).replace("\t", " ")
    return parse_fields(_TAG.sub("", _YAML_HEADER.sub("", text)), name)


def _xml(text: str, path: str) -> Field:
    from xml.etree.ElementTree import ParseError

    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root = fromstring(text.encode())
    except (ParseError, ValueError, DefusedXmlException) as error:
        line = getattr(error, "position", (None, 0))[0]
        raise DatasetError(path, f"not XML: {str(error)[:CAUSE_LENGTH]}", line) from None
    return Field(path, _plain(root, path, 0), {})


def _plain(element: Element, path: str, depth: int) -> Any:
    """Convert an element to data: a mapping of its children, a list of children named `_`, or words."""
    if depth > _DEEPEST:
        raise DatasetError(path, f"nested deeper than {_DEEPEST} levels; OpenCV writes no such file")
    inner = list(element)
    if any(child.tag != "_" for child in inner):
        fields: dict[str, Any] = {}
        for child in inner:
            if child.tag in fields:
                raise DatasetError(path, "is given twice: keep one", field=child.tag)
            fields[child.tag] = _plain(child, path, depth + 1)
        return fields
    if inner:
        return [_plain(child, path, depth + 1) for child in inner]
    words = [_word(word) for word in (element.text or "").split()]
    return words[0] if len(words) == 1 else words


def _word(word: str) -> Any:
    try:
        return int(word) if re.fullmatch(r"[+-]?\d{1,18}", word) else float(word)
    except ValueError:
        return word.strip('"')
