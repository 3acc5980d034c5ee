"""`dropped-sample` as a warning: many samples could not be used."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding

_MANY_SHARE = 0.1  # share of the samples above which a warning is added to the infos about single samples; assumed


def many_dropped_samples(inputs: Input) -> list[Finding]:
    """A warning if more than a tenth of the samples could not be used, according to the findings so far."""
    about = {name for f in inputs.findings if f.code == "dropped-sample" for name in f.about}
    dropped = {name for name in about if name.isdecimal()}
    total = len(inputs.problem.samples) + len(dropped)
    if len(dropped) <= _MANY_SHARE * total or any(f.code == "few-images" for f in inputs.findings):
        return []
    most = max((f for f in inputs.findings if f.code == "dropped-sample"), key=lambda f: len(f.about))
    what = f"{len(dropped)} of {total} samples could not be used."
    return [Finding("dropped-sample", "warning", (), what, most.do, most.what)]
