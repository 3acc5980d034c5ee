"""The unit of CPU time: products of a matrix, so that times of different machines and days can be compared."""

from __future__ import annotations

import time
from statistics import median

import numpy as np

PRODUCTS, ROWS, COLUMNS = 20, 200, 600
_UNITS_A_TIME = 7


def unit_s() -> float:
    """Time of the unit now [s], the median of a few."""
    matrix = np.random.default_rng(0).standard_normal((ROWS, COLUMNS))

    def work() -> float:
        began = time.process_time()
        for _ in range(PRODUCTS):
            matrix @ matrix.T
        return time.process_time() - began

    return median(work() for _ in range(_UNITS_A_TIME))
