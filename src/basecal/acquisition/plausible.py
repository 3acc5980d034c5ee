"""Whether a state that a driver gives can be that of a robot at all."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.acquisition.states import vector_of
from basecal.errors import DriverError

_MOST_RAD_M = 1e3  # of a joint, of a position's coordinate: a thousand turns, a kilometre


def check_reading(name: str, reading: Reading) -> None:
    """Refuse a state whose stamp, joints or pose is not finite, or beyond any robot.

    Raises:
        DriverError: if it is.
    """
    values = np.append(vector_of(reading.state), reading.stamp_s)
    if not np.isfinite(values).all():
        raise DriverError(f"{name}: its controller sent a state that is not finite")
    if np.abs(values[:-1]).max() > _MOST_RAD_M:
        raise DriverError(f"{name}: its controller sent a state beyond any robot: {np.abs(values[:-1]).max():.3g}")
