"""Tests of the number of digits by the sigma."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.exports.digits import (
    angle_decimals,
    format_decimals,
    format_pose,
    length_decimals,
    unit_decimals,
)
from basecal.geometry import SE3, PoseEstimate
from export_example import ESTIMATE


def estimate_with(sigma_m: float, sigma_rad: float) -> PoseEstimate:
    return PoseEstimate(SE3.identity(), np.diag([sigma_m**2] * 3 + [sigma_rad**2] * 3))


@pytest.mark.parametrize(("sigma_mm", "decimals"), [(0.052, 4), (0.099, 4), (0.11, 3), (1.1, 2), (52.0, 1), (520, 0)])
def test_lengths_have_two_digits_beyond_sigma(sigma_mm, decimals):
    """A sigma of 0.05 mm justifies hundredths, plus two digits."""
    assert length_decimals(estimate_with(sigma_mm * 1e-3, 1), 1e-3) == decimals
    assert length_decimals(estimate_with(sigma_mm * 1e-3, 1), 1.0) == decimals + 3


def test_exact_values_have_nanometre_digits():
    """Without a sigma lengths are written to a nanometre."""
    assert length_decimals(estimate_with(0, 0), 1.0) == 9
    assert length_decimals(estimate_with(0, 0), 1e-3) == 6
    assert angle_decimals(estimate_with(0, 0), 1.0) == 9


def test_quaternions_keep_unit_norm():
    """Quaternions have at least six decimals, however large the sigma."""
    assert unit_decimals(estimate_with(1, 0.3)) == 6
    assert unit_decimals(estimate_with(1, 3e-6)) == 8


def test_rounding_is_below_hundredth_of_sigma():
    """The pose that the numbers give back is within a hundredth of a sigma, in every convention."""
    for kind in (CONTROLLERS["ur"], CONTROLLERS["kuka"], CONTROLLERS["abb"]):
        again = kind.read(np.array([float(number) for number in format_pose(kind, ESTIMATE)]))
        off = np.abs((ESTIMATE.mean.inverse() @ again).log())
        assert np.all(off[:3] < 0.01 * ESTIMATE.sigma_t.min())
        assert np.all(off[3:] < 0.01 * ESTIMATE.sigma_r.min())


def test_negative_zeros_are_not_written():
    """Some programs read a sign before zeros as an option."""
    assert format_decimals([-1e-9, 0.0, -0.5], 3) == ["0.000", "0.000", "-0.500"]


@pytest.mark.parametrize(("sigma_deg", "decimals"), [(0.052, 4), (0.11, 3), (3.0, 2), (30.0, 1)])
def test_angles_have_digits_of_their_unit(sigma_deg, decimals):
    """A sigma of 0.05 deg justifies hundredths of a degree plus two digits; radians have more decimals."""
    radians = np.radians(sigma_deg)
    assert angle_decimals(estimate_with(1, radians), np.radians(1)) == decimals
    assert angle_decimals(estimate_with(1, 1e-3), 1.0) == 5
    assert angle_decimals(estimate_with(1, 0), np.radians(1)) == 8


def test_smallest_sigma_determines_digits():
    """The smallest sigma of the three axes counts, for lengths and for angles."""
    estimate = PoseEstimate(SE3.identity(), np.diag([1.0, 1e-8, 1.0, 1.0, 1.0, 1e-6]))
    assert length_decimals(estimate, 1.0) == 6
    assert angle_decimals(estimate, 1.0) == 5


@pytest.mark.parametrize(("name", "decimals"), [("kuka", (4, 3)), ("ur", (7, 5)), ("abb", (4, 6)), ("ros", (7, 6))])
def test_rotations_have_digits_of_their_format(name, decimals):
    """Degrees and radians have digits by sigma, quaternions at least six, beside lengths in millimetres or metres."""
    numbers = format_pose(CONTROLLERS[name], estimate_with(5e-5, np.radians(0.2)))
    found = [len(number.partition(".")[2]) for number in numbers]
    assert found == [decimals[0]] * 3 + [decimals[1]] * (len(numbers) - 3)
