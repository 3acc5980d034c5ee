"""Lines of `cell.yaml` that findings propose, and findings that `basecal fix` can fix."""

from __future__ import annotations

import re
from typing import Any

from basecal.cell import Cell, Finding
from basecal.cell.format.yaml_text import parse_yaml
from basecal.errors import BasecalError
from basecal.fields.problems import Loc

_OFFER = re.compile(r"\b[Ww]rite (`[a-z_]+: .+)")
_LINE = re.compile(r"`([a-z_]+: [^`]+)`")
# Fields of a camera that a finding may propose; findings about a camera may also propose lines of its target.
_OF_CAMERAS = ("clock", "rolling_shutter")
_COMMAND = "`basecal fix "


def is_fixable(cell: Cell, finding: Finding) -> bool:
    """Whether a warning or error names `basecal fix`, or proposes lines that this command can write."""
    if finding.severity == "info":
        return False
    return _COMMAND in finding.message or bool(offered_places(cell, finding))


def offered_places(cell: Cell, finding: Finding) -> dict[Loc, Any]:
    """Lines that a finding proposes, by location in `cell.yaml`; empty if it proposes none.

    The lines apply to the targets, robots and cameras that the sentence quotes, else to those that the finding is
    about.
    """
    kinds = {"cameras": cell.cameras, "targets": cell.targets, "robots": cell.robots}
    places = {name: (kind, name) for kind, entries in kinds.items() for name in entries}
    for text in (*finding.do, finding.why, finding.what):
        if lines := _offered_lines(text):
            quoted = [name for name in places if repr(name) in text]
            owners = quoted or [name for name in finding.about if name in places]
            found = {(*places[name], key): value for name in owners for key, value in lines.items()}
            return {place: found[place] for place in found if place[0] != "cameras" or place[2] in _OF_CAMERAS}
    return {}


def _offered_lines(text: str) -> dict[str, Any]:
    """Values of the `cell.yaml` lines in backquotes after "write" in a sentence, by field."""
    found = _OFFER.search(text)
    lines = ", ".join(_LINE.findall(found[1])) if found else ""
    try:
        data: dict[str, Any] = parse_yaml(f"{{{lines}}}", "finding").data
    except BasecalError:
        return {}
    return data
