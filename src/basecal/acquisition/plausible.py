"""Whether a reading can be that of a robot, the same for every driver."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.acquisition.states import state_vector
from basecal.errors import DriverError

_LARGEST_JOINT_RAD = 1e3  # of a joint: 159 turns, more than any counter of turns
_LARGEST_DISTANCE_M = 1e3  # of a flange from its base
_ROTATION_TOLERANCE = 1e-3  # by which a rotation matrix may miss orthonormality: printed numbers are rounded


def check_reading(name: str, reading: Reading) -> None:
    """Refuse a reading that no robot can give.

    Raises:
        DriverError: if a number is not finite, a joint is beyond 1000 rad, or a flange is beyond 1 km.
    """
    if problem := _problem(reading):
        raise DriverError(
            f"{name}: implausible state: {problem}. The controller or its driver sends wrong numbers. "
            f"Check the driver's units and what the controller shows"
        )


def _problem(reading: Reading) -> str:
    if (reading.state.joints_rad is None) == (reading.state.base_from_flange is None):
        return "expected joints or a pose of the flange, one of them"
    values = state_vector(reading.state)
    if not np.isfinite(reading.stamp_s):
        return f"its stamp is {reading.stamp_s}"
    if not values.size:
        return "it has no joints"
    if not np.all(np.isfinite(values)):
        return f"a number is not finite: {values}"
    if reading.state.joints_rad is not None:
        worst = int(np.argmax(np.abs(values)))
        return f"joint {worst + 1} is at {values[worst]:.3g} rad" if abs(values[worst]) > _LARGEST_JOINT_RAD else ""
    if (distance_m := float(np.abs(values[:3]).max())) > _LARGEST_DISTANCE_M:
        return f"the flange is {distance_m:.3g} m from its base"
    rotation = values[3:].reshape(3, 3)
    return "" if np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE else "its rotation is none"
