"""Sums of values by group, ten times as fast as `numpy.add.at`."""

from __future__ import annotations

from math import prod

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.geometry import Array, IntArray


class GroupSums:
    """Sums by group over one axis; `group`, (n,), is the group of each entry, from 0 to `count` - 1."""

    def __init__(self, group: IntArray, count: int) -> None:
        order = np.argsort(group, kind="stable")
        ends = np.searchsorted(group[order], np.arange(count + 1))
        self._matrix = scipy.sparse.csr_array((np.ones(len(group)), order, ends), shape=(count, len(group)))

    def sum(self, values: Array, axis: int = 0) -> Array:
        """Sum values, (..., n, ...) with the entries along an axis, to (..., count, ...)."""
        first = np.moveaxis(values, axis, 0)
        flat: Array = self._matrix @ first.reshape(len(first), prod(first.shape[1:]))
        return np.moveaxis(flat.reshape(len(flat), *first.shape[1:]), 0, axis)
