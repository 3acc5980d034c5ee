"""The defaults that docs/studies.md states of the fields of a study."""

from __future__ import annotations

import re
from pathlib import Path

DOCUMENT = Path(__file__).parents[2] / "docs" / "studies.md"


def documented_defaults() -> dict[str, object]:
    """Default by field; of fields that share a row, and a single default, it is that of each."""
    table = DOCUMENT.read_text(encoding="utf-8").partition("| field | by default |")[2].partition("\n\n")[0]
    found: dict[str, object] = {}
    for row in table.splitlines()[2:]:
        _, fields, stated, *_ = row.split("|")
        names, values = re.findall(r"`(\w+)`", fields), [each.strip(" `") for each in stated.split(",")]
        if " or " in fields:
            names = names[:1]
        for name, value in zip(names, values * (len(names) if len(values) == 1 else 1), strict=True):
            found[name] = _read(value)
    return found


def _read(text: str) -> object:
    if text in ("true", "false"):
        return text == "true"
    return float(text) if re.fullmatch(r"[\d.]+", text) else text
