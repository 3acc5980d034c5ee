"""Arms led by a person: a sample is due each time they are held still at a new place, or a key is pressed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack

import numpy as np

from basecal.acquisition.driver import Freedrives, Moves, Robot
from basecal.acquisition.freshness import Patience
from basecal.acquisition.rig import Rig
from basecal.acquisition.stillness import wait_until_hand_guided
from basecal.acquisition.taking import Notify
from basecal.cell import RobotState
from basecal.geometry import Array

TAKE_KEY, END_KEY = " ", "q"
"""Keys that take a sample now, and end the capture."""

_HOLD_S = 0.8  # of rest, after which a sample is due: with less, a short pause would take a sample
_REST_TOLERANCE_RAD_M = 1e-3  # largest motion of arms that are held still
_LEAST_MOTION_RAD_M = 0.03  # from the last sample to a new place

Key = Callable[[], str]
"""Function that returns the key pressed since the previous call; empty if none."""


def wait_for_hand_guided_arms(rig: Rig, states: Mapping[str, RobotState], patience_s: float) -> dict[str, RobotState]:
    """Wait until a person has led the live robots that cannot be moved by program; their new states, by name.

    Raises:
        Unfit: if a robot was not led to another place before the timeout [s].
    """
    guided = {name: robot for name, robot in rig.robots.items() if robot.is_live and not isinstance(robot, Moves)}
    if not guided:
        return {}
    with release_arms(guided.values()):
        wait_until_hand_guided(guided, states, patience_s, rig.arms.note)
    return {name: robot.state().state for name, robot in guided.items()}


def release_arms(robots: Iterable[Robot]) -> ExitStack:
    """Context in which arms are in freedrive, if their drivers support it."""
    with ExitStack() as held:
        for robot in robots:
            if isinstance(robot, Freedrives):
                robot.freedrive(True)
                held.callback(robot.freedrive, False)
        return held.pop_all()


class HandGuiding:
    """Leading of a rig's live robots by a person; arms with a freedrive are free until a sample is due."""

    def __init__(self, rig: Rig, key: Key, report: Notify) -> None:
        self._rig, self._key, self._notify = rig, key, report
        self._last_values: Array | None = None

    def wait(self) -> bool:
        """Wait until a sample is due; False if the person ended the capture.

        Without live robots, a sample is due at once: a person who types poses has moved the robots.

        Raises:
            DriverError: if a robot does not answer.
        """
        live = {name: robot for name, robot in self._rig.robots.items() if robot.is_live}
        if not live:
            return self._key() != END_KEY
        self._notify("lead the arms to a new place and hold them still, or press space; q ends")
        with release_arms(live.values()):
            return self._wait_until_due(live)

    def _wait_until_due(self, live: Mapping[str, Robot]) -> bool:
        rest_values, hold = None, Patience(_HOLD_S)
        while True:
            readings = [robot.state() for robot in live.values()]
            for name, reading in zip(live, readings, strict=True):
                self._rig.arms.note(name, reading)
            values = np.concatenate([reading.state.vector for reading in readings])
            if rest_values is None or np.abs(values - rest_values).max() > _REST_TOLERANCE_RAD_M:
                rest_values, hold = values, Patience(_HOLD_S)
            is_held = hold.is_over(readings[0].stamp_s)
            key = self._key()
            is_new = self._last_values is None or bool(np.abs(values - self._last_values).max() > _LEAST_MOTION_RAD_M)
            if key == TAKE_KEY or (is_new and is_held):
                self._last_values = values
                return True
            if key == END_KEY:
                return False
