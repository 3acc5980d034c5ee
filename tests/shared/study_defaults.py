"""Defaults of the fields of a study, as docs/studies.md states them."""

from __future__ import annotations

import re
from pathlib import Path

DOCUMENT = Path(__file__).parents[2] / "docs" / "studies.md"


def documented_defaults() -> dict[str, object]:
    """Defaults by field; fields that share a row and a single default all have it."""
    table = DOCUMENT.read_text(encoding="utf-8").partition("| field | by default |")[2].partition("\n\n")[0]
    defaults: dict[str, object] = {}
    for row in table.splitlines()[2:]:
        _, fields, stated, *_ = row.split("|")
        names, values = re.findall(r"`(\w+)`", fields), [each.strip(" `") for each in stated.split(",")]
        if " or " in fields:
            names = names[:1]
        for name, value in zip(names, values * (len(names) if len(values) == 1 else 1), strict=True):
            defaults[name] = _read(value)
    return defaults


def _read(text: str) -> object:
    if text in ("true", "false"):
        return text == "true"
    return float(text) if re.fullmatch(r"[\d.]+", text) else text
