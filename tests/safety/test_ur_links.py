"""Tests of failing UR links through ur-rtde: the other arm is stopped, and no goal is sent afterwards."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.rig import open_rig
from basecal.acquisition.stillness import wait_for_arms
from basecal.cell import Driver, RobotState
from basecal.errors import DriverError
from shared.ur_place import CELL, controller

pytest.importorskip("rtde_control")

pytestmark = pytest.mark.timed

FAR = RobotState(joints_rad=np.array([2.0, -1.5, 1.5, 0.0, 0.5, 0.0]))
FAULTS = {
    "freeze_link": ("no state came", 0.6),
    "hang_up": ("closed", 0.3),
    "protective_stop": ("protective stop", 0.3),
    "safeguard_stop": ("safeguard stop", 0.3),
    "emergency_stop": ("emergency stop", 0.3),
    "violation": ("violation", 0.3),
    "stop_program": ("the program on the controller was stopped", 0.3),
    "nan": ("finite", 0.3),
    "length_zero": ("ended|lost|closed", 0.6),
}
"""What the reason says, and within which time [s] the other arm is told."""


def events(process):
    """Events at a controller: time [s], event, and whether the arm moved."""
    entries = (entry.split(":") for entry in process.tell("log").split())
    return [(float(at_s), what, moved == "moving") for at_s, what, moved in entries]


def _move_until_stopped(cell, fail):
    """Move both arms, make one fail, and read states for four seconds."""
    with open_rig(cell, Path(".")) as rig:
        wait_for_arms(rig.robots, {}, 5.0)
        for robot in rig.robots.values():
            assert robot.goal_refusal(FAR) == ""
        for robot in rig.robots.values():
            robot.move(FAR, 0.3)
        time.sleep(0.3)
        fail()
        until = time.monotonic() + 4
        while time.monotonic() < until:
            for robot in rig.robots.values():
                robot.state()


@pytest.mark.parametrize("fault", FAULTS)
def test_other_arm_is_stopped_in_time(fault):
    """If one of two moving arms fails, the other stops in time, no program is sent again, and the reason is true."""
    why, allowed_s = FAULTS[fault]
    with ExitStack() as stack:
        (eye, eye_place), (hand, hand_place) = (stack.enter_context(controller()) for _ in range(2))
        drivers = {"eye": Driver("ur", eye_place().options), "hand": Driver("ur", hand_place().options)}
        robots = {name: replace(CELL.robots[name], driver=drivers[name]) for name in ("hand", "eye")}
        cell = replace(CELL, robots=robots, cameras={})
        failed: list[float] = []
        with pytest.raises(DriverError, match=why) as raised:
            _move_until_stopped(cell, lambda: (failed.append(time.monotonic()), eye.tell(fault)))
        failed_s = failed[0]
        ended_s = time.monotonic() - failed_s
        told = [at_s - failed_s for at_s, what, moved in events(hand) if what == "stopj" and moved]
        after = [what for at_s, what, _ in events(hand) + events(eye) if at_s > failed_s and what in ("move", "script")]
    assert "eye" in str(raised.value)
    assert 0 < told[0] < allowed_s
    assert ended_s < allowed_s + 2
    assert after == []
