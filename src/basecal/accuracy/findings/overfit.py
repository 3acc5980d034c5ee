"""`overfit`: held-out samples are predicted much worse than samples that are used fit."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.cross_validation.validation import HeldOutErrors, root_mean
from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding

_OVERFIT_RATIO = (
    4.0  # rms ratio: with enough samples it is near one, and nears two where unknowns are half the equations
)
_ROUNDING = 1e-12  # cost of a view that fits to rounding: synthetic cells without noise


def overfit(evidence: Evidence) -> list[Finding]:
    """A warning if the cross-validation error is more than four times the residual of the same samples."""
    if evidence.cross_validation is None or evidence.cross_validation.summary is None:
        return []
    used, predicted = evidence.cross_validation.fitted, evidence.cross_validation.predicted
    ratio = np.sqrt(predicted.cost / used.cost) if used.cost > 0 and np.isfinite(predicted.cost) else np.inf
    if ratio <= _OVERFIT_RATIO or predicted.cost <= _ROUNDING * max(predicted.count_px, predicted.count_poses):
        return []
    compared = _comparison(used, predicted)
    what = f"The cross-validation error is {ratio:.1f} times the residual of the same samples when used{compared}."
    do = ("Record more, or state what is known as a prior.",)
    return [Finding("overfit", "warning", (), what, do, "There are too few samples for all that is unknown.")]


def _comparison(used: HeldOutErrors, held_out: HeldOutErrors) -> str:
    """Both errors in pixels, or in mm and degrees."""
    inside, outside = (root_mean(e.square_px, e.count_px) for e in (used, held_out))
    if inside is not None and outside is not None:
        return f" ({outside:.2f} px against {inside:.2f} px)"
    inside, outside = (root_mean(e.square_m, e.count_poses) for e in (used, held_out))
    return "" if inside is None or outside is None else f" ({1e3 * outside:.2f} mm against {1e3 * inside:.2f} mm)"
