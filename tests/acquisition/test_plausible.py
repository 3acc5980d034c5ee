"""States that no robot has."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.driver import Reading
from basecal.acquisition.plausible import check_reading
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.geometry import SE3


def joints(*values, stamp_s=1.0):
    """A state of joints."""
    return Reading(stamp_s, RobotState(joints_rad=np.array(values)))


@pytest.mark.parametrize("bad", [joints(0.0, np.nan), joints(np.inf, 0.0), joints(0.0, 0.0, stamp_s=np.nan)])
def test_what_is_not_finite_is_refused(bad):
    """A joint or a stamp that is NaN or infinite is refused with the robot's name."""
    with pytest.raises(DriverError, match="eye: its controller sent a state that is not finite"):
        check_reading("eye", bad)


def test_what_no_robot_reaches_is_refused():
    """A joint of 1e308 rad, and a flange two kilometres away, are refused; many turns, and late stamps, are not."""
    far = Reading(0.0, RobotState(SE3(np.eye(3), np.array([2e3, 0.0, 0.0]))))
    for bad in (joints(1e308, 0.0), far):
        with pytest.raises(DriverError, match="eye: its controller sent a state beyond any robot"):
            check_reading("eye", bad)
    check_reading("eye", joints(-999.0, 6.3, stamp_s=2e9))
