"""Samples that name points which a target does not have: a finding for each target, however many they are."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.cell.calibration import Finding
from basecal.cell.journal.sample_line import Dropped


def unknown_points(dropped: Sequence[Dropped], path: str) -> list[Finding]:
    """What is said of samples that were dropped for the ids of their points, in the order of the file.

    Args:
        dropped: The samples.
        path: The file they stand in.
    """
    by_target: dict[str, list[Dropped]] = {}
    for each in dropped:
        by_target.setdefault(each.reason.target, []).append(each)
    return [_finding(of, path) for of in by_target.values()]


def _finding(dropped: Sequence[Dropped], path: str) -> Finding:
    first, numbers = dropped[0], tuple(str(each.sample) for each in dropped)
    who = f"sample {first.sample} is" if len(dropped) == 1 else f"sample {first.sample} and {len(dropped) - 1} more are"
    message = f"{path}:{first.line}: {who} dropped: {first.reason}{_from_one(dropped)}"
    return Finding("dropped-sample", "info", numbers, message)


def _from_one(dropped: Sequence[Dropped]) -> str:
    """A clause where ids seem to count from the next number on."""
    seen = frozenset[int]().union(*(each.reason.ids for each in dropped))
    known = dropped[0].reason.known
    if (min(seen), max(seen)) != (min(known) + 1, max(known) + 1):
        return ""
    return f"; ids count from {min(known)}: subtract 1 from each"
