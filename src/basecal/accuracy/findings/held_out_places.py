"""`held-out-places`: touches at held-out places have larger errors than noise explains."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.stated_sigmas import judge_sigma
from basecal.cell import Finding
from basecal.fields.digits import two_digits


def held_out_places(evidence: Evidence) -> list[Finding]:
    """An info about the mark with the largest held-out error over its noise, if noise does not explain this error."""
    if not evidence.held_out_places:
        return []
    worst = max(evidence.held_out_places, key=lambda each: each.ratio)
    judged = judge_sigma(worst.mark, False, worst.ratio**2 * worst.freedoms, worst.freedoms)
    if judged is None or not judged.is_too_small:
        return []
    error, noise = two_digits(1e3 * worst.error_m), two_digits(1e3 * worst.error_m / worst.ratio)
    what = f"Touches of {worst.mark}, held out with their place, are off by {error} mm; {noise} mm is expected."
    why = "The arm has an error there that its model does not contain."
    do = ("Touch marks at more places where the arm will work.",)
    return [Finding("held-out-places", "info", (worst.mark,), what, do, why)]
