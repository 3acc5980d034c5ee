"""`not-validated`: samples that could not be held out."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Finding


def not_validated(evidence: Evidence) -> list[Finding]:
    """An info about samples that cannot be held out, since a requested transform cannot be estimated without them.

    The info also reports if no samples can be held out.
    """
    found = evidence.cross_validation
    if found is None or not (found.skipped or not found.summary):
        return []
    if not found.skipped:
        what = "There is no cross-validation: the samples cannot be split into folds."
        return [Finding("not-validated", "info", (), what, ("Record more samples.",))]
    numbers = tuple(map(str, sorted(found.skipped)))
    free = [name for name in evidence.cell.requested_transforms if name in evidence.solution.problem.columns]
    names = " and ".join(free) or "the solution"
    shown = list_samples(sorted(found.skipped)).capitalize()
    them, their = ("it", "its") if len(numbers) == 1 else ("them", "their")
    what = f"{shown} could not be held out in cross-validation."
    why = f"Without {them}, {names} cannot be estimated."
    return [Finding("not-validated", "info", numbers, what, (f"Record more of {their} kind.",), why)]
