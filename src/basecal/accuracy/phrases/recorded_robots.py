"""Advice on robots, depending on the recorded quantity."""

from __future__ import annotations

from collections.abc import Sequence


def advise_check(robots: Sequence[str]) -> str:
    """Advice on robots whose joints were recorded; advice on recorded poses if `robots` is empty."""
    if not robots:
        return "Check that poses are base_from_flange in metres, of the named robot."
    return f"Check the URDF of {' and '.join(robots)}, and the unit, signs and order of the joints."
