"""Tests of `basecal.numerics.group_sums`."""

import numpy as np

from basecal.numerics.group_sums import GroupSums


def test_group_sums_along_any_axis(rng):
    """Sums are correct for groups in any order, groups without entries, and no entries at all.

    Entries may be without numbers.
    """
    group = np.array([3, 0, 3, 1, 3])
    values = rng.standard_normal((5, 2, 4))
    expected = np.zeros((5, 2, 4))
    np.add.at(expected, group, values)
    sums = GroupSums(group, 5)
    np.testing.assert_allclose(sums.sum(values), expected, rtol=1e-14)
    np.testing.assert_allclose(sums.sum(np.moveaxis(values, 0, 1), 1), np.moveaxis(expected, 0, 1), rtol=1e-14)
    np.testing.assert_allclose(sums.sum(np.moveaxis(values, 0, -1), -1), np.moveaxis(expected, 0, -1), rtol=1e-14)
    assert sums.sum(values[:, :0]).shape == (5, 0, 4)
    np.testing.assert_array_equal(GroupSums(group[:0], 2).sum(values[:0]), np.zeros((2, 2, 4)))
