"""Numbers with as many digits as their sigma justifies, and two more."""

from __future__ import annotations

import math
from collections.abc import Iterable

from basecal.exchange.controllers.convention import AnyConvention
from basecal.geometry import PoseEstimate

_EXTRA_DIGITS = 2  # rounding then adds less than a hundredth of a sigma
_FINEST = 1e-9  # [m] or [rad]: of what is known exactly
_QUATERNION = 3 + 4  # numbers of a pose whose rotation is a quaternion
_FEWEST_OF_UNIT = 6  # of a quaternion or matrix, so that programs take its norm for 1


def length_decimals(estimate: PoseEstimate, metres: float) -> int:
    """Decimals of lengths whose unit is so many metres."""
    return _decimals(float(estimate.sigma_t.min()) / metres, metres)


def angle_decimals(estimate: PoseEstimate, radians: float) -> int:
    """Decimals of angles whose unit is so many radians."""
    return _decimals(float(estimate.sigma_r.min()) / radians, radians)


def unit_decimals(estimate: PoseEstimate) -> int:
    """Decimals of the numbers of a quaternion or a rotation matrix: at least so many that its norm is 1 to 1e-6."""
    return max(angle_decimals(estimate, 1.0), _FEWEST_OF_UNIT)


def written_numbers(convention: AnyConvention, estimate: PoseEstimate) -> list[str]:
    """A pose in a controller's numbers, of which three are lengths and the rest a rotation."""
    numbers, is_unit = convention.to_numbers(estimate.mean), len(convention.names) == _QUATERNION
    rotation = unit_decimals(estimate) if is_unit else angle_decimals(estimate, convention.angle)
    return format_decimals(numbers[:3], length_decimals(estimate, convention.length)) + format_decimals(
        numbers[3:], rotation
    )


def format_decimals(values: Iterable[float], decimals: int) -> list[str]:
    """Numbers with a fixed count of decimals; none is a negative zero."""
    return [f"{round(float(value), decimals) + 0.0:.{decimals}f}" for value in values]


def _decimals(sigma: float, unit: float) -> int:
    smallest = max(sigma * 10.0**-_EXTRA_DIGITS, _FINEST / unit)
    return max(0, -math.floor(math.log10(smallest)))
