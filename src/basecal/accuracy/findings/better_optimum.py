"""`better-optimum`: another start or the certificate led to a lower cost, or a closed form predicts better."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.fields.digits import two_digits


def guess_finding() -> Finding:
    """An info that the answer does not start from the stated guesses, because these led to an implausible one."""
    what = "The guesses of the cell led to an answer in which the recorded poses do not explain the views."
    do = ("Correct the guesses in cell.yaml, or remove them.",)
    return Finding("better-optimum", "info", (), what, do, "The answer was found without the guesses.")


def better_optimum(evidence: Evidence) -> list[Finding]:
    """An info if the certificate led to another optimum than the start; a warning if a closed form predicts better."""
    found = []
    if evidence.solution is not evidence.robust.solution:
        what = f"The start led to a local optimum of cost {evidence.robust.solution.cost:.6g}."
        why = f"The certificate led to one of {evidence.solution.cost:.6g}, which is the answer."
        found.append(Finding("better-optimum", "info", (), what, why=why))
    rival = None if evidence.cross_validation is None else evidence.cross_validation.rival
    if rival is not None:
        ratio = two_digits(rival.ratio)
        what = f"A closed form of single views predicts held-out views {ratio} times better than the answer."
        why = "The answer weighs the views by their noise. The covariance covers both."
        do = ("Check stated sigmas and priors, what is fixed, and outliers.",)
        found.append(Finding("better-optimum", "warning", (), what, do, why))
    return found
