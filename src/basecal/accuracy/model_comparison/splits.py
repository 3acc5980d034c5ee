"""Two means in place of one, of which nobody says which items have which: every way to split them is a test.

The chance is at most that of one split times their number, by Bonferroni; that of one is of variances that are
estimated. Source: Fisher 1925.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from basecal.accuracy.model_comparison.comparison import Comparison, decide
from basecal.accuracy.model_comparison.nested_models import LEAST_CHANCE, SINGLE_LEVEL


def compare_split(rival: str, ratio: float, count: int, width: int) -> Comparison:
    """Two means by what they leave of the sum of squares about one.

    Args:
        rival: Its name.
        ratio: Sum of squares about the two means over that about one.
        count: Items.
        width: Numbers of each.
    """
    left = width * (count - 2)
    statistic = (1 / max(ratio, LEAST_CHANCE) - 1) * left / width
    log_one = float(np.log(max(float(fdtrc(width, left, statistic)), LEAST_CHANCE)))
    return decide(
        rival, -left * float(np.log(max(ratio, LEAST_CHANCE))), log_one + (count - 1) * np.log(2), SINGLE_LEVEL
    )
