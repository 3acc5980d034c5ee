"""`overfit`: prediction errors of held-out samples are far above the residuals and the expectation from covariance."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.cross_validation.validation import HeldOutErrors, root_mean_square
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Finding
from basecal.fields.digits import two_digits

_ROUNDING = 1e-12  # cost of a view whose residuals are rounding errors: synthetic cells without noise


def overfit(evidence: Evidence) -> list[Finding]:
    """A warning if the cross-validation error is above the expectation from the residuals and the covariance.

    Few samples may hardly determine a direction, so that held-out predictions are poor: at worst with one degree of
    freedom.
    """
    if evidence.cross_validation is None or evidence.cross_validation.summary is None:
        return []
    used, predicted = evidence.cross_validation.fitted, evidence.cross_validation.predicted
    expected = used.cost + predicted.uncertain
    ratio = np.sqrt(predicted.cost / expected) if expected > 0 and np.isfinite(predicted.cost) else np.inf
    is_expected = not compare_nested_models(ratio**2, 1).is_taken
    if is_expected or predicted.cost <= _ROUNDING * max(predicted.count_px, predicted.count_poses):
        return []
    compared = _comparison(used, predicted)
    what = f"The cross-validation error is {ratio:.1f} times its expected value{compared}."
    do = ("Record more, or state what is known as a prior.",)
    return [Finding("overfit", "warning", (), what, do, "The covariance is too small to explain this error.")]


def _comparison(errors: HeldOutErrors, held_out: HeldOutErrors) -> str:
    """Both errors in pixels or mm, as text; empty if neither is known."""
    inside, outside = (root_mean_square(e.square_px, e.count_px) for e in (errors, held_out))
    if inside is not None and outside is not None:
        return f" ({two_digits(outside)} px against {two_digits(inside)} px)"
    inside, outside = (root_mean_square(e.square_m, e.count_poses) for e in (errors, held_out))
    if inside is None or outside is None:
        return ""
    return f" ({two_digits(1e3 * outside)} mm against {two_digits(1e3 * inside)} mm)"
