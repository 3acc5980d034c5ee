"""Arms that a person leads: each time they are held still at a new place, or a key is pressed, a sample is due."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack

import numpy as np

from basecal.acquisition.driver import Freedrives, Moves, Robot
from basecal.acquisition.freshness import Patience
from basecal.acquisition.rig import Rig
from basecal.acquisition.stillness import wait_until_led
from basecal.acquisition.taking import Notify
from basecal.cell import RobotState
from basecal.geometry import Array

TAKE_KEY, END_KEY = " ", "q"
"""Keys: take a sample now, and end."""

_HOLD_S = 0.8  # of rest, after which a sample is due: shorter, a person who thinks would take some
_REST_TOLERANCE = 1e-3  # [rad, m] by which arms that are held still may move
_LEAST_MOTION = 0.03  # [rad, m] from where the last sample was due: nearer it is no new place

Key = Callable[[], str]
"""The key that was pressed since it was last asked; empty if none was."""


def wait_for_led_arms(rig: Rig, states: Mapping[str, RobotState], patience_s: float) -> dict[str, RobotState]:
    """Where arms that a person leads have come to: of those that are live, but are not sent.

    Raises:
        Unfit: if they were not led to another place in time.
    """
    led = {name: robot for name, robot in rig.robots.items() if robot.is_live and not isinstance(robot, Moves)}
    if not led:
        return {}
    with release_arms(led.values()):
        wait_until_led(led, states, patience_s, rig.arms.note)
    return {name: robot.state().state for name, robot in led.items()}


def release_arms(robots: Iterable[Robot]) -> ExitStack:
    """Lets arms be led, where their drivers can do that, until it is closed."""
    with ExitStack() as held:
        for robot in robots:
            if isinstance(robot, Freedrives):
                robot.freedrive(True)
                held.callback(robot.freedrive, False)
        return held.pop_all()


class Led:
    """A person who leads the live robots of a rig; where drivers can do that, arms are free until a sample is due."""

    def __init__(self, rig: Rig, key: Key, report: Notify) -> None:
        self._rig, self._key, self._notify = rig, key, report
        self._last: Array | None = None

    def wait(self) -> bool:
        """Wait until a sample is due; False where the person has ended.

        Of robots whose states do not come without a request nothing is awaited: whoever types a pose is there.

        Raises:
            DriverError: if a robot does not answer.
        """
        live = {name: robot for name, robot in self._rig.robots.items() if robot.is_live}
        if not live:
            return self._key() != END_KEY
        self._notify("lead the arms to a new place and hold them still, or press space; q ends")
        with release_arms(live.values()):
            return self._is_due(live)

    def _is_due(self, live: Mapping[str, Robot]) -> bool:
        at, held = None, Patience(_HOLD_S)
        while True:
            readings = [robot.state() for robot in live.values()]
            for name, reading in zip(live, readings, strict=True):
                self._rig.arms.note(name, reading)
            now = np.concatenate([reading.state.vector for reading in readings])
            if at is None or np.abs(now - at).max() > _REST_TOLERANCE:
                at, held = now, Patience(_HOLD_S)
            is_held = held.is_over(readings[0].stamp_s)
            key = self._key()
            is_new = self._last is None or bool(np.abs(now - self._last).max() > _LEAST_MOTION)
            if key == TAKE_KEY or (is_new and is_held):
                self._last = now
                return True
            if key == END_KEY:
                return False
