"""Models compared by how likely they make parts of the recording that were held out, part by part.

Parts are what shares no error: stations, samples. The mean gain over its standard error is Student's t if neither
predicts better. Source: paired comparison, Student 1908; the logarithmic score of predictions, Good 1952.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from basecal.accuracy.model_comparison.nested_models import (
    CONFIRMED,
    LEAST_CHANCE,
    SUSPECTED,
    Comparison,
    Decision,
    decide,
)
from basecal.estimation.start.rotation_search import KEPT_SHARE
from basecal.geometry import Array

CLEARLY = 1.1
"""Ratio of likelihoods of a held-out part below which two models predict equally; `benchmarks.mutations` sets it.

Estimators that weigh the same views otherwise differ by a few hundredths, models by more.
"""


def compare_predicted_gains(gains: Array) -> Comparison:
    """A rival by its gains, taken if they are beyond chance, and undecided if they may be.

    Args:
        gains: (n,) of each held-out part: by how much less minus twice its log likelihood is with the rival.
    """
    return decide(float(np.sum(gains)), _log_chance(gains), CONFIRMED, SUSPECTED)


def compare_predictions(squares: Array, in_use: Array, clearly: float = CLEARLY) -> Comparison:
    """A rival by the errors of its predictions; undecided if neither model predicts clearly better beyond chance.

    Errors count as Cauchy-distributed, so that a few parts that either model predicts badly do not outweigh the rest.

    Args:
        squares: (n,) squared error of each held-out part by the rival.
        in_use: (n,) likewise by the model in use.
        clearly: Ratio of likelihoods of a part beyond which the rival predicts clearly better, by their geometric mean.
    """
    scale = max(min(_trimmed_mean(squares), _trimmed_mean(in_use)), LEAST_CHANCE)
    gains = np.log1p(in_use / scale) - np.log1p(squares / scale)
    chance, ratio = _log_chance(gains), float(np.exp(np.mean(gains))) if len(gains) else 1.0
    if chance < np.log(CONFIRMED) and ratio > clearly:
        decision = Decision.TAKE
    elif _log_chance(-gains) < np.log(SUSPECTED) and ratio < 1 / CLEARLY:
        decision = Decision.KEEP
    else:
        decision = Decision.UNDECIDED
    return Comparison(2 * float(np.sum(gains)), chance, decision)


def _trimmed_mean(squares: Array) -> float:
    """Mean of the share of squares that are least."""
    kept = np.sort(squares)[: int(np.ceil(KEPT_SHARE * len(squares)))]
    return float(np.mean(kept)) if len(kept) else np.inf


def _log_chance(gains: Array) -> float:
    count, total = len(gains), float(np.sum(gains))
    spread = float(np.std(gains, ddof=1)) * np.sqrt(count) if count > 1 else 0.0
    chance = float(stdtr(count - 1, -total / max(spread, LEAST_CHANCE))) if count > 1 and total else 0.5
    return float(np.log(max(chance, LEAST_CHANCE)))
