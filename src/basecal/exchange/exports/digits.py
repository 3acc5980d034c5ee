"""Formatting of numbers with the digits justified by their sigma, and two more."""

from __future__ import annotations

import math
from collections.abc import Iterable

from basecal.exchange.controllers.convention import AnyConvention
from basecal.geometry import PoseEstimate

_EXTRA_DIGITS = 2  # rounding then adds less than a hundredth of a sigma
_RESOLUTION = 1e-9  # [m] or [rad], of exact numbers
_FEWEST_UNIT_DECIMALS = 6  # of a quaternion or matrix, so that programs accept its norm as 1


def length_decimals(estimate: PoseEstimate, metres: float) -> int:
    """Number of decimals of lengths in a unit of `metres`."""
    return _decimals(float(estimate.sigma_t.min()) / metres, metres)


def angle_decimals(estimate: PoseEstimate, radians: float) -> int:
    """Number of decimals of angles in a unit of `radians`."""
    return _decimals(float(estimate.sigma_r.min()) / radians, radians)


def unit_decimals(estimate: PoseEstimate) -> int:
    """Number of decimals of a quaternion or a rotation matrix; at least 6, so that its norm is 1 within 1e-6."""
    return max(angle_decimals(estimate, 1.0), _FEWEST_UNIT_DECIMALS)


def format_pose(convention: AnyConvention, estimate: PoseEstimate) -> list[str]:
    """Format a pose as a controller's numbers: three lengths, then the rotation."""
    numbers = convention.to_numbers(estimate.mean)
    decimals = angle_decimals(estimate, convention.angle) if convention.has_angles else unit_decimals(estimate)
    lengths = format_decimals(numbers[:3], length_decimals(estimate, convention.length))
    return lengths + format_decimals(numbers[3:], decimals)


def format_decimals(values: Iterable[float], decimals: int) -> list[str]:
    """Format numbers with a fixed number of decimals, without negative zeros."""
    return [f"{round(float(value), decimals) + 0.0:.{decimals}f}" for value in values]


def _decimals(sigma: float, unit: float) -> int:
    smallest = max(sigma * 10.0**-_EXTRA_DIGITS, _RESOLUTION / unit)
    return max(0, -math.floor(math.log10(smallest)))
