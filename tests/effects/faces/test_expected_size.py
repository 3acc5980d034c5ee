"""Priors of what is expected."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.faces.expected_size import ExpectedSize, SigmaPrior


@pytest.mark.parametrize("kinds", [1, 2, 3, 7])
def test_of_all_kinds_none_is_as_likely_as_some(kinds):
    """The others are equally likely, whatever their number."""
    prior = SigmaPrior.as_often_as_not(np.array([1e-4, 3e-4, 1e-3]), kinds)
    np.testing.assert_array_equal(prior.sigmas, [0, 1e-4, 3e-4, 1e-3])
    np.testing.assert_allclose(prior.shares[0] ** kinds, 0.5)
    np.testing.assert_allclose(prior.shares[1:], (1 - prior.shares[0]) / 3)


def test_sigmas_of_several_sizes_keep_their_rows():
    """None of any size, or one of the rows."""
    prior = SigmaPrior.as_often_as_not(np.eye(2))
    np.testing.assert_array_equal(prior.sigmas, [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_allclose(prior.shares, [0.5, 0.25, 0.25])


def test_an_expected_size_is_within_two_deviations_either_way():
    """Five values by its factor, or none."""
    found = ExpectedSize(2.0, 3.0, "assumed").prior(3)
    np.testing.assert_allclose(found.sigmas, [0, 2 / 9, 2 / 3, 2, 6, 18])
    np.testing.assert_allclose(found.shares[0] ** 3, 0.5)


def test_a_sigma_that_is_known_is_certain():
    """One value, and not none."""
    prior = SigmaPrior.single_value(0.3)
    assert (prior.sigmas.tolist(), prior.shares.tolist()) == ([0.3], [1.0])
