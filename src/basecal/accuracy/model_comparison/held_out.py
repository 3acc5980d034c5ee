"""Comparison of models by the likelihoods of held-out parts of the recording.

Parts share no errors: they are stations or samples. The mean gain over its standard error has Student's t distribution
if neither model predicts better. Source: paired comparison, Student 1908; the logarithmic score of predictions, Good
1952.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from basecal.accuracy.model_comparison.nested_models import (
    CONFIRMED_LEVEL,
    LEAST_CHANCE,
    SUSPECTED_LEVEL,
    Comparison,
    Decision,
    decide,
)
from basecal.estimation.start.rotation_search import KEPT_SHARE
from basecal.geometry import Array

CLEAR_RATIO = 1.1
"""Likelihood ratio of a held-out part below which two models predict equally; chosen by `benchmarks.mutations`.

Estimators that weight the same views differently differ by a few hundredths, models by more.
"""


def compare_predicted_gains(gains: Array) -> Comparison:
    """Compare a rival model with the model in use by its gains on held-out parts.

    The rival is taken if the gains are significant, and undecided if they are suspicious.

    Args:
        gains: (n,) decrease of minus twice the log likelihood of each held-out part by the rival.
    """
    return decide(float(np.sum(gains)), _log_chance(gains), CONFIRMED_LEVEL, SUSPECTED_LEVEL)


def compare_predictions(squares: Array, in_use: Array, clear_ratio: float = CLEAR_RATIO) -> Comparison:
    """Compare a rival model with the model in use by the errors of predictions.

    The comparison is undecided if neither model predicts significantly and clearly better. Errors are modelled as
    Cauchy-distributed, so that a few badly predicted parts do not outweigh the rest.

    Args:
        squares: (n,) squared error of each held-out part by the rival.
        in_use: (n,) squared error of each held-out part by the model in use.
        clear_ratio: Geometric mean of the parts' likelihood ratios above which the rival predicts clearly better.
    """
    scale = max(min(_trimmed_mean(squares), _trimmed_mean(in_use)), LEAST_CHANCE)
    gains = np.log1p(in_use / scale) - np.log1p(squares / scale)
    chance, ratio = _log_chance(gains), float(np.exp(np.mean(gains))) if len(gains) else 1.0
    if chance < np.log(CONFIRMED_LEVEL) and ratio > clear_ratio:
        decision = Decision.TAKE
    elif _log_chance(-gains) < np.log(SUSPECTED_LEVEL) and ratio < 1 / CLEAR_RATIO:
        decision = Decision.KEEP
    else:
        decision = Decision.UNDECIDED
    return Comparison(2 * float(np.sum(gains)), chance, decision)


def _trimmed_mean(squares: Array) -> float:
    """Mean of the smallest squares, of which the share `KEPT_SHARE` is kept."""
    kept = np.sort(squares)[: int(np.ceil(KEPT_SHARE * len(squares)))]
    return float(np.mean(kept)) if len(kept) else np.inf


def _log_chance(gains: Array) -> float:
    count, total = len(gains), float(np.sum(gains))
    spread = float(np.std(gains, ddof=1)) * np.sqrt(count) if count > 1 else 0.0
    chance = float(stdtr(count - 1, -total / max(spread, LEAST_CHANCE))) if count > 1 and total else 0.5
    return float(np.log(max(chance, LEAST_CHANCE)))
