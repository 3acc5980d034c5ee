"""`board-shape`: a target that is not shaped as stated: a board that is not flat, points in space that are off."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Finding
from basecal.effects.target_shape import freedoms, words


def board_shape(evidence: Evidence) -> list[Finding]:
    """An info about each target that is off its shape beyond chance; a warning if none is made so badly."""
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
