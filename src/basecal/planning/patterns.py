"""Every pattern: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.planning import poses, shifts
from basecal.planning.pattern import Pattern

PATTERNS: Mapping[str, Pattern] = {
    "poses": poses.PATTERN,
    "shifts": shifts.PATTERN,
}
"""By their names in `basecal capture --pattern`."""
