"""Formatting of numbers with the digits justified by their sigma, and two more."""

from __future__ import annotations

import math
from collections.abc import Iterable

from basecal.exchange.controllers.convention import AnyConvention
from basecal.geometry import PoseEstimate

_EXTRA_DIGITS = 2  # rounding then adds less than a hundredth of a sigma
_FINEST = 1e-9  # [m] or [rad]: resolution of exact numbers
_QUATERNION = 3 + 4  # numbers of a pose whose rotation is a quaternion
_FEWEST_OF_UNIT = 6  # decimals of a quaternion or matrix, so that programs accept its norm as 1


def length_decimals(estimate: PoseEstimate, metres: float) -> int:
    """Number of decimals of lengths in a unit of `metres`."""
    return _decimals(float(estimate.sigma_t.min()) / metres, metres)


def angle_decimals(estimate: PoseEstimate, radians: float) -> int:
    """Number of decimals of angles in a unit of `radians`."""
    return _decimals(float(estimate.sigma_r.min()) / radians, radians)


def unit_decimals(estimate: PoseEstimate) -> int:
    """Number of decimals of a quaternion or a rotation matrix; at least 6, so that its norm is 1 within 1e-6."""
    return max(angle_decimals(estimate, 1.0), _FEWEST_OF_UNIT)


def written_numbers(convention: AnyConvention, estimate: PoseEstimate) -> list[str]:
    """Format a pose as a controller's numbers: three lengths, then the rotation."""
    numbers, is_unit = convention.to_numbers(estimate.mean), len(convention.names) == _QUATERNION
    rotation = unit_decimals(estimate) if is_unit else angle_decimals(estimate, convention.angle)
    return format_decimals(numbers[:3], length_decimals(estimate, convention.length)) + format_decimals(
        numbers[3:], rotation
    )


def format_decimals(values: Iterable[float], decimals: int) -> list[str]:
    """Format numbers with a fixed number of decimals, without negative zeros."""
    return [f"{round(float(value), decimals) + 0.0:.{decimals}f}" for value in values]


def _decimals(sigma: float, unit: float) -> int:
    smallest = max(sigma * 10.0**-_EXTRA_DIGITS, _FINEST / unit)
    return max(0, -math.floor(math.log10(smallest)))
