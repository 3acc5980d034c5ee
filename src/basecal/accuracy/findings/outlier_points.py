"""`outlier-points`: points that were left out."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.outlier import list_outliers
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Finding

_FEW_SHARE = 0.1  # share of the points: detectors usually produce a few outliers; assumed


def outlier_points(evidence: Evidence) -> list[Finding]:
    """A finding about samples with outlier points; a warning above one point in ten."""
    outliers = [o for o in evidence.robust.outliers if o.ids]
    count = sum(len(o.ids) for o in outliers)
    if not count:
        return []
    numbers, total = sorted({o.sample for o in outliers}), evidence.robust.points + count
    what = f"{count} of {total} points were left out as outliers, in {list_samples(numbers)}."
    why = list_outliers(outliers, evidence.images)
    look = "Look for reflections, covered or blurred parts of the target, and ids of another target."
    do = look, "Samples count from 0."
    return [
        Finding(
            "outlier-points",
            "warning" if count > _FEW_SHARE * total else "info",
            tuple(map(str, numbers)),
            what,
            do,
            why,
        )
    ]
