"""`board-shape`: a target whose shape is not as stated: a board that is not flat, or wrong 3-D points."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Finding
from basecal.effects.target_shape import freedoms, words


def board_shape(evidence: Evidence) -> list[Finding]:
    """A finding about each target whose shape deviates significantly; a warning if the deviation is implausible."""
    findings = []
    for name, (shape, spread) in evidence.solution.noise.shapes.items():
        target = evidence.cell.targets[name].target
        if target is None:
            continue
        statistic = float(shape @ np.linalg.solve(spread, shape))
        if not compare_nested_models(statistic, freedoms(target.points, shape)).is_taken:
            continue
        found = words(name, target.points, shape)
        if found is not None:
            findings.append(Finding(found.code, found.severity, (name,), found.what, found.do, found.why))
    return findings
