"""`better-optimum`: another start or the certificate led to less cost, or a closed form predicts better."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding


def guess_led_astray() -> Finding:
    """An info that the transforms stated as guesses were not started from."""
    message = "the guesses of the cell led to where the recorded poses do not explain the views"
    return Finding("better-optimum", "info", (), f"{message}: the answer starts without them")


def better_optimum(of: Evidence) -> list[Finding]:
    """An info where the answer is not the optimum the start had led to; a warning where a closed form is better."""
    found = []
    if of.solution is not of.robust.solution:
        message = (
            f"the start led to a local optimum of cost {of.robust.solution.cost:.6g}, the certificate to one of "
            f"{of.solution.cost:.6g}: the answer is the latter"
        )
        found.append(Finding("better-optimum", "info", (), message))
    rival = None if of.cross_validation is None else of.cross_validation.rival
    if rival is not None:
        message = (
            f"a closed form of the poses of single views predicts held-out views {rival.ratio:.2g} times better than "
            "the answer, which weighs them by their noise: the covariance covers both; look at stated sigmas and "
            "priors, at what is fixed, and at outliers"
        )
        found.append(Finding("better-optimum", "warning", (), message))
    return found
