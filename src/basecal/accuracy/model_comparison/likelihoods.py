"""Models of equally many parameters, such as two shapes of noise, compared by their likelihoods.

The mean ratio over the values of a number that the rival leaves open is an e-value. By Markov's inequality, the chance
that it exceeds c is at most 1 / c if the model in use is true. Source: Vovk and Wang 2021, arXiv:1912.06116.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.model_comparison.comparison import Comparison, decide
from basecal.accuracy.model_comparison.nested_models import SUSPECTED
from basecal.geometry import Array


def compare_likelihoods(rival: str, log_ratios: Array) -> Comparison:
    """A rival by the log ratios of its likelihood over that of the model in use, at each value of an open number.

    Neither model is simpler: the rival is taken where the other would have to be suspected.

    Args:
        rival: Its name.
        log_ratios: (n,) for each value, all equally probable; none if the rival has no value.
    """
    if not len(log_ratios):
        return decide(rival, -np.inf, 0.0, SUSPECTED)
    log_mean = float(np.logaddexp.reduce(log_ratios) - np.log(len(log_ratios)))
    return decide(rival, 2 * float(np.max(log_ratios)), -log_mean, SUSPECTED)
