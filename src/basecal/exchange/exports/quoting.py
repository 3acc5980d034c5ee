"""Names and texts of others as one word of another language, which cannot end the place where they are written."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from io import StringIO
from typing import Any

from basecal.errors import printable

_ENDS = "\r\n"
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def yaml_word(text: str) -> str:
    """A string of YAML, of both its versions, on one line and in ASCII."""
    return '"' + "".join(c if _is_plain(c) else f"\\U{ord(c):08x}" for c in text) + '"'


def _is_plain(character: str) -> bool:
    return character.isascii() and character.isprintable() and character not in '"\\'


def csv_row(cells: Iterable[str], numbers: Iterable[str] = ()) -> str:
    """A row of comma-separated values; a text that a table would calculate as a formula starts with `'`."""
    text = StringIO()
    texts = [f"'{cell}" if cell.startswith(_FORMULA) else cell for cell in cells]
    csv.writer(text, lineterminator=_ENDS).writerow([*texts, *numbers])  # quotes what holds any of them
    return text.getvalue().removesuffix(_ENDS)


def xml_comment(text: str) -> Any:
    """An element of XML that is a comment, and holds no two hyphens in a row."""
    from xml.etree.ElementTree import Comment

    return Comment(f" {re.sub('-(?=-)', '- ', printable(text))} ")
