"""Priors of what is expected."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.faces.effect import (
    ExpectedSize,
    FoundEffect,
    SigmaPrior,
    format_tangent,
    format_with_sigma,
    rounded_length,
)


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


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [(0.12345, 0.0123, "0.123 ± 0.012"), (12.3, 4.0, "12.3 ± 4.0"), (5.0, 0.0, "5.000000000 ± 0.000000000")],
)
def test_two_digits_of_sigma(value, sigma, text):
    """As many of the value."""
    assert format_with_sigma(value, sigma) == text


def test_a_length_has_the_sigma_along_it():
    """In the unit requested; across it the sigma does not count."""
    assert rounded_length(np.array([3e-3, 4e-3]), np.diag([1e-6, 1e-6]), 1e3) == "5.0 ± 1.0"
    assert rounded_length(np.array([5e-3, 0.0]), np.diag([1e-6, 1.0]), 1e3) == "5.0 ± 1.0"


def test_a_tangent_is_a_shift_and_a_rotation():
    """In millimetres and degrees."""
    size, covariance = np.array([2e-3, 0, 0, 0, np.radians(0.5), 0]), np.diag([1e-8] * 3 + [1e-6] * 3)
    found = FoundEffect("step", "base-moved", "eye", False, False, 3, "", size, covariance, np.zeros(6))
    assert format_tangent(size, covariance) == " by 2.00 ± 0.10 mm and 0.500 ± 0.057 deg"
    assert found.sigma == pytest.approx(1e-4)


def test_a_point_has_a_shift_alone():
    """In millimetres."""
    assert format_tangent(np.array([2e-3, 0, 0]), np.diag([1e-8] * 3)) == " by 2.00 ± 0.10 mm"


def test_a_size_within_its_sigma_is_not_told():
    """Of a tangent the directions that are known alone; nothing where none is longer than its sigma."""
    shift, turn = np.array([1e-3, 2e-4, 0.0]), np.array([0.1, 0.0, 0.0])
    covariance = np.diag([25e-6, 1e-10, 1e-10, 0.16, 1e-8, 1e-8])
    assert format_tangent(np.append(shift, turn), covariance) == " by 0.200 ± 0.010 mm"
    assert format_tangent(np.append(0 * shift, turn), covariance) == ""


def test_a_sigma_that_is_known_is_certain():
    """One value, and not none."""
    prior = SigmaPrior.single_value(0.3)
    assert (prior.sigmas.tolist(), prior.shares.tolist()) == ([0.3], [1.0])
