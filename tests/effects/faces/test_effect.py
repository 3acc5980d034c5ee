"""Tests of priors of expected sizes, and of numbers in messages."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.effects.faces.effect import (
    DEGREE,
    MILLI,
    ONE,
    SECOND,
    Effect,
    ExpectedSize,
    FoundEffect,
    LensParameter,
    RandomEffect,
    SigmaPrior,
    SimulatedFault,
    _known_part,
    clearest_joint,
    format_length,
    format_tangent,
    format_with_sigma,
)
from basecal.effects.faces.shared_errors import KINEMATICS


@pytest.mark.parametrize("kinds", [1, 2, 3, 7])
def test_no_effect_is_as_likely_as_some(kinds):
    """The probability of no effect over all kinds is one half, whatever their number; the sigmas are equally likely."""
    prior = SigmaPrior.spike_and_slab(np.array([1e-4, 3e-4, 1e-3]), kinds)
    np.testing.assert_array_equal(prior.sigmas, [0, 1e-4, 3e-4, 1e-3])
    np.testing.assert_allclose(prior.probabilities[0] ** kinds, 0.5)
    np.testing.assert_allclose(prior.probabilities[1:], (1 - prior.probabilities[0]) / 3)


def test_prior_of_several_sizes_keeps_rows():
    """The prior has a row of zeros, and each of the given rows."""
    prior = SigmaPrior.spike_and_slab(np.eye(2))
    np.testing.assert_array_equal(prior.sigmas, [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_allclose(prior.probabilities, [0.5, 0.25, 0.25])


def test_expected_size_prior_spans_two_deviations():
    """The prior has zero and five values, spaced by the factor."""
    found = ExpectedSize(2.0, 3.0, "assumed").prior(3)
    np.testing.assert_allclose(found.sigmas, [0, 2 / 9, 2 / 3, 2, 6, 18])
    np.testing.assert_allclose(found.probabilities[0] ** 3, 0.5)


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.12345, 0.0123, "0.123 ± 0.012"),
        (12.3, 4.0, "12.3 ± 4.0"),
        (5.0, 0.0996, "5.00 ± 0.10"),
        (5.0, 0.0, "5.000000000 ± 0.000000000"),
    ],
)
def test_value_has_two_digits_of_sigma(value, sigma, text):
    """The value is rounded to the two digits of its sigma."""
    assert format_with_sigma(value, sigma) == text


def test_length_sigma_is_along_vector():
    """The length is in the requested unit; the sigma across the vector has no effect."""
    assert format_length(np.array([3e-3, 4e-3]), np.diag([1e-6, 1e-6]), 1e3) == "5.0 ± 1.0"
    assert format_length(np.array([5e-3, 0.0]), np.diag([1e-6, 1.0]), 1e3) == "5.0 ± 1.0"


def test_tangent_is_shift_and_rotation():
    """A tangent is printed in millimetres and degrees."""
    size, covariance = np.array([2e-3, 0, 0, 0, np.radians(0.5), 0]), np.diag([1e-8] * 3 + [1e-6] * 3)
    found = FoundEffect("step", "base-moved", "eye", False, False, 3, "", size, covariance, np.zeros(6))
    assert format_tangent(size, covariance) == " by 2.00 ± 0.10 mm and 0.500 ± 0.057 deg"
    assert found.sigma == pytest.approx(1e-4)


def test_point_tangent_is_shift_only():
    """A tangent of three numbers is printed as a shift in millimetres."""
    assert format_tangent(np.array([2e-3, 0, 0]), np.diag([1e-8] * 3)) == " by 2.00 ± 0.10 mm"


def test_size_within_sigma_is_not_printed():
    """Only well-determined directions of a tangent are printed, and none if no part exceeds its sigma."""
    shift, turn = np.array([1e-3, 2e-4, 0.0]), np.array([0.1, 0.0, 0.0])
    covariance = np.diag([25e-6, 1e-10, 1e-10, 0.16, 1e-8, 1e-8])
    assert format_tangent(np.append(shift, turn), covariance) == " by 0.200 ± 0.010 mm"
    assert format_tangent(np.append(0 * shift, turn), covariance) == ""


def test_known_sigma_has_single_value_prior():
    """A single value has probability 1, and zero is not a value."""
    prior = SigmaPrior.single_value(0.3)
    assert (prior.sigmas.tolist(), prior.probabilities.tolist()) == ([0.3], [1.0])


ANY, RANDOM = object(), SimpleNamespace(is_mapped=False)


@pytest.mark.parametrize(
    ("parts", "faces"),
    [
        ({}, ""),
        ({"parameter": ANY}, "statement unknown map"),
        ({"lens": ANY}, "statement size unknown words"),
        ({"target": ANY}, "size random words"),
        ({"random": RANDOM}, "size random words"),
        ({"random": SimpleNamespace(is_mapped=True)}, "size random words map"),
        ({"expected": ANY}, "size random"),
        ({"candidates": ANY}, "candidate"),
        ({"words": ANY}, "words"),
        ({"fault": ANY}, "fault"),
        ({"elsewhere": {"map": "somewhere", "size": "somewhere"}, "fault": ANY}, "map size fault"),
    ],
)
def test_aspects_follow_from_parts(parts, faces):
    """Aspects follow from an effect's parts, and include those implemented in another module."""
    assert Effect("one", **parts).faces == set(faces.split())


@pytest.mark.parametrize(
    ("sigma", "text"),
    [
        (0.0123, "0.120 ± 0.012"),
        (0.0999, "0.12 ± 0.10"),
        (0.101, "0.12 ± 0.10"),
        (1.0, "0.1 ± 1.0"),
        (9.6, "0.1 ± 9.6"),
        (10.0, "0 ± 10"),
        (12345.0, "0 ± 12345"),
        (3e-9, "0.120000000 ± 0.000000003"),
    ],
)
def test_number_has_digits_of_its_sigma(sigma, text):
    """A number has from zero to nine decimals, as its sigma justifies."""
    assert format_with_sigma(0.12, sigma) == text


def found(size, sigmas, joint=None):
    covariance = np.diag(np.array(sigmas) ** 2)
    return FoundEffect("", "", "eye", False, False, None, "", np.array(size), covariance, np.zeros(1), joint)


def test_clearest_joint_is_most_significant():
    """The clearest joint is not the one farthest off; joints without a sigma are skipped.

    A single size belongs to the effect's own joint.
    """
    assert clearest_joint(found([3.0, -2.0, 0.1], [1.0, 0.1, 1.0]), 10.0, "deg") == (2, "-20.0 ± 1.0 deg")
    assert clearest_joint(found([0.1, 9.0, 0.5], [0.1, 0.0, 0.1]), 1.0, "%") == (3, "0.50 ± 0.10 %")
    assert clearest_joint(found([0.5], [0.1], joint=4), 1.0, "%") == (5, "0.50 ± 0.10 %")
    assert clearest_joint(found([0.5], [0.1], joint=0), 1.0, "%") == (1, "0.50 ± 0.10 %")


def test_tangent_length_is_per_part():
    """Shift and rotation each have the length of their own columns."""
    size, sigmas = np.array([3e-3, 0, 4e-3, 0.02, 0.0, 0.0]), np.array([1e-4] * 3 + [1e-3] * 3)
    assert format_tangent(size, np.diag(sigmas**2)) == " by 5.00 ± 0.10 mm and 1.146 ± 0.057 deg"
    assert format_tangent(size[[3, 4, 5, 0, 1, 2]] / 10, np.diag(sigmas**2)) == " by 2.00 ± 0.10 mm"
    assert format_length(np.zeros(3), np.eye(3), 1.0) == "0.000000000 ± 0.000000000"
    assert format_length(np.array([0.3, 0.4]), np.diag([0.01, 0.04]), 10.0) == "5.0 ± 1.7"


def test_effect_defaults_are_false():
    """Effects are neither by place nor in time, sudden, certain or mapped unless stated.

    A detected effect is certain.
    """
    effect = Effect("made_up")
    assert (effect.is_by_place, effect.is_in_time, effect.faces) == (False, False, frozenset())
    random = RandomEffect(KINEMATICS, "")
    flags = random.is_of_poses_alone, random.is_by_coordinate, random.is_certain, random.is_mapped
    assert flags == (False,) * 4
    assert not SimulatedFault("", "", 1.0, 1.0, "").is_sudden
    assert not LensParameter(slice(0, 1), lambda camera: np.zeros(1), "", lambda *given: "").is_each_alone
    assert not ExpectedSize(1.0, 1.0, "").is_stated
    found = FoundEffect("", "", "", False, False, None, "", np.zeros(1), np.array([[4.0]]), np.zeros(0))
    assert (found.is_certain, found.probability, found.alternatives, found.joint, found.sigma) == (
        True,
        1.0,
        (),
        None,
        2.0,
    )


def test_fault_units_are_si():
    """Degrees, milli-units and seconds are factors to radians, metres and seconds."""
    assert pytest.approx([np.pi / 180, 0.001, 1, 1]) == [DEGREE, MILLI, SECOND, ONE]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_tangent_is_limited_to_known_directions(scale):
    """Directions with a huge sigma are left out, as few as needed; the result is zero if none exceeds its sigma."""
    size = scale * np.array([3e-3, 4e-3, 50e-3])
    covariance = scale**2 * np.diag([1e-8, 1e-8, 1e-2])
    np.testing.assert_allclose(_known_part(size, covariance), scale * np.array([3e-3, 4e-3, 0]), atol=scale * 1e-12)
    np.testing.assert_allclose(_known_part(size, 1e-4 * covariance), size, rtol=1e-9)
    np.testing.assert_array_equal(_known_part(size, 1e9 * covariance), np.zeros(3))


def test_length_is_printed_in_given_unit():
    """The scale multiplies length and sigma; a zero length has a zero sigma."""
    covariance = np.diag([0.04, 0.01])
    assert format_length(np.array([3.0, 0.0]), covariance, 1.0) == "3.00 ± 0.20"
    assert format_length(np.array([0.0, 3.0]), covariance, 100.0) == "300 ± 10"
    assert format_length(np.zeros(2), covariance, 1.0).startswith("0.000000000 ± 0.000000000")
    assert format_tangent(np.array([1.0, 0, 0, 1, 0, 0]), np.diag([1e-4] * 3 + [1e-4] * 3)).endswith(" deg")
