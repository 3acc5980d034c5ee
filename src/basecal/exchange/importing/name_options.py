"""Options of the form NAME=WORDS, which may be given several times."""

from __future__ import annotations

from collections.abc import Iterable

from basecal.errors import UsageError


def parse_name_options(option: str, arguments: Iterable[str], form: str) -> dict[str, str]:
    """Words by the names before their equals signs.

    Raises:
        UsageError: if one has none, or a name comes twice.
    """
    found: dict[str, str] = {}
    for each in arguments:
        name, _, words = each.partition("=")
        if not name or not words or name in found:
            raise UsageError(f"{option} {each}: {'given twice' if name in found else f'expected {form}'}")
        found[name] = words
    return found
