"""Tests of the registry of patterns."""

from __future__ import annotations

from basecal.planning import poses, shifts
from basecal.planning.patterns import PATTERNS


def test_patterns_are_found_by_name():
    """Each name gives the plan function of its module."""
    assert {"poses": poses.plan, "shifts": shifts.plan} == PATTERNS
