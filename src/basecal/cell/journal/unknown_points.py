"""Samples that name points which a target does not have: a finding for each target, however many they are."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.cell.calibration import Finding
from basecal.cell.journal.sample_line import Dropped


def unknown_points(drops: Sequence[Dropped], path: str) -> list[Finding]:
    """Findings about samples that were dropped for the ids of their points, in the order of the file.

    Args:
        drops: The samples.
        path: The file they stand in.
    """
    by_target: dict[str, list[Dropped]] = {}
    for each in drops:
        by_target.setdefault(each.reason.target, []).append(each)
    findings = []
    for of in by_target.values():
        first, others, known = of[0], len(of) - 1, of[0].reason.known
        who = f"sample {first.sample} and {others} more are" if others else f"sample {first.sample} is"
        seen = frozenset[int]().union(*(each.reason.ids for each in of))
        from_one = (min(seen), max(seen)) == (min(known) + 1, max(known) + 1)
        do = (f"Subtract 1 from each id: they count from {min(known)}.",) if from_one else ()
        what = f"{path}:{first.line}: {who} dropped: {first.reason}."
        findings.append(Finding("dropped-sample", "info", tuple(str(each.sample) for each in of), what, do))
    return findings
