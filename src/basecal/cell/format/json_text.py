"""JSON as people read it: what holds no more than numbers and words stands on a line of its own."""

from __future__ import annotations

import json
from typing import Any


def indent_json(value: Any, level: int = 0) -> str:
    """The text of plain data, indented by a space a level; a row of numbers is one line.

    Raises:
        ValueError: if a number is not finite.
    """
    parts = list(value.values() if isinstance(value, dict) else value) if isinstance(value, dict | list) else []
    if {dict, list}.isdisjoint(map(type, parts)):
        return json.dumps(value, allow_nan=False)
    inside, outside = "\n" + " " * (level + 1), "\n" + " " * level
    texts = [indent_json(part, level + 1) for part in parts]
    if isinstance(value, dict):
        named = (f"{json.dumps(key)}: {text}" for key, text in zip(value, texts, strict=True))
        return "{" + inside + ("," + inside).join(named) + outside + "}"
    return "[" + inside + ("," + inside).join(texts) + outside + "]"
