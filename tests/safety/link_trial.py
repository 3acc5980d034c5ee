"""One trial: two arms by drivers of others, one of which fails, and what their controllers were told then."""

from __future__ import annotations

import json
import re
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.acquisition.rig import Rig, open_rig
from basecal.acquisition.stillness import wait_for_arms
from basecal.cell import Cell, Driver, Robot, RobotState
from basecal.errors import DriverError
from tests.safety.frail_controllers import WATCHDOG_S
from tests.shared.second_process import second_process

FAULTS = ("freeze", "cut", "delay", "protective", "safeguard", "emergency", "drop", "lie", "nan", "crash")
PHASES = ("idle", "moving", "rest", "reconnecting")
ARMS = ("left", "right")
SPEED_RAD_S = 0.4
FAR, NEAR = RobotState(joints_rad=np.full(6, 3.0)), RobotState(joints_rad=np.full(6, 0.1))
RECONNECT_S = 1.0
HELD_S = 2.0  # an arm that says that it stands still on its way counts as held up after so long
REST_S = RECONNECT_S + 2.0  # a link that is silent while all arms stand counts as lost after so long
TOLERATED = {("delay", "idle"), ("delay", "rest"), ("lie", "idle"), ("lie", "rest")}
"""Faults at rest that endanger nobody: states that come late, or never change, of an arm that stands."""

WORDS = {
    "freeze": "no state came",
    "cut": "closed|gone",
    "delay": "no state came|late",
    "protective": "protective stop",
    "safeguard": "safeguard stop",
    "emergency": "emergency stop",
    "drop": "program was stopped",
    "lie": "is at rest, but not at its goal",
    "nan": "not finite|finite",
    "crash": "process of its driver ended",
}


@dataclass(frozen=True)
class Trial:
    """What is done to which arm, and when."""

    fault: str
    arm: str
    order: tuple[str, str]
    phase: str
    seed: int


@dataclass(frozen=True)
class Outcome:
    """What became of it; times in seconds after the fault, None where it did not happen.

    In phase `reconnecting` the link is cut before the fault already. A stop between the two has a negative time.
    """

    other_stopped_s: float | None
    faulty_halted_s: float | None
    ended_s: float | None
    moves_after: int
    error: str


def attempt(trial: Trial) -> Outcome:
    """Run one trial."""
    rng = np.random.default_rng([trial.seed, FAULTS.index(trial.fault), PHASES.index(trial.phase)])
    size = f"{rng.uniform(0.6, 5):.3f}" if trial.fault == "delay" else ""
    with second_process("safety.frail_controllers") as controllers:
        ports = json.loads(controllers.tell("ports"))
        robots = {
            name: Robot(name, driver=Driver("frail", {"port": ports[name], "reconnect_s": RECONNECT_S}))
            for name in trial.order
        }
        fault_s, ended_s, error = float("nan"), None, ""

        def fail() -> None:
            nonlocal fault_s
            fault_s = time.monotonic()
            controllers.tell("fail", trial.arm, trial.fault, size)

        try:
            with open_rig(Cell(trial.order[0], robots), Path(".")) as rig:
                _until_phase(rig, trial, controllers, rng)
                timer = threading.Timer(float(rng.uniform(0.1, 0.4)), fail)
                timer.start()
                _go_on(rig, trial)
        except DriverError as raised:
            ended_s, error = time.monotonic() - fault_s, str(raised)
        time.sleep(0.7)
        log = json.loads(controllers.tell("log"))
    return _outcome(trial, log, fault_s, ended_s, error)


def _until_phase(rig: Rig, trial: Trial, controllers, rng) -> None:
    wait_for_arms(rig.robots, {}, 5.0)
    if trial.phase in ("rest", "reconnecting"):
        for robot in rig.robots.values():
            robot.move(NEAR, 10 * SPEED_RAD_S)
        wait_for_arms(rig.robots, dict.fromkeys(rig.robots, NEAR), 5.0)
        time.sleep(0.2)
    if trial.phase == "reconnecting":
        controllers.tell("fail", trial.arm, "cut")
        time.sleep(0.2)
        if trial.fault != "cut":
            threading.Timer(float(rng.uniform(0.1, 0.4)), controllers.tell, ("mend", trial.arm)).start()
    if trial.phase == "moving":
        for robot in rig.robots.values():
            robot.move(FAR, SPEED_RAD_S)


def _go_on(rig: Rig, trial: Trial) -> None:
    """Read states as a capture does, at most twenty seconds; at rest no arm is sent."""
    until = time.monotonic() + 5
    while time.monotonic() < until:
        for robot in rig.robots.values():
            robot.state()


def _outcome(trial: Trial, log, fault_s: float, ended_s: float | None, error: str) -> Outcome:
    other = next(name for name in ARMS if name != trial.arm)
    since_s = min([fault_s, *(at for at, what in log[trial.arm] if what.startswith("fault"))])
    stops = [at - fault_s for at, what in log[other] if what == "stop" and at >= since_s]
    halts = [at - fault_s for at, what in log[trial.arm] if what.startswith("halted") and at >= fault_s - 0.05]
    moves = sum(what == "move" and at > since_s for name in ARMS for at, what in log[name])
    return Outcome(min(stops, default=None), min(halts, default=None), ended_s, moves, error)


def allowed_s(trial: Trial) -> float | None:
    """Within which time after the fault the other arm is told to stop; None if nothing needs to happen.

    0.3 s after an event, 0.6 s after a link falls silent while an arm moves. While all arms stand, a lost link is tried
    again for `reconnect_s`, and nothing is sent meanwhile.
    """
    if trial.phase == "moving":
        return {"freeze": 0.6, "delay": 0.6, "lie": HELD_S + 0.3}.get(trial.fault, 0.3)
    if trial.phase == "reconnecting":
        return None if trial.fault in ("delay", "lie") else REST_S + 0.4
    if (trial.fault, trial.phase) in TOLERATED:
        return None
    return {"freeze": REST_S + 0.3, "cut": RECONNECT_S + 0.3}.get(trial.fault, 0.3)


def faults_found(trial: Trial, outcome: Outcome) -> list[str]:
    """What of an outcome breaks a promise, in words."""
    allowed, found = allowed_s(trial), []
    if outcome.moves_after:
        found.append(f"{outcome.moves_after} moves were sent afterwards")
    if allowed is None:
        return found
    if outcome.other_stopped_s is None or outcome.other_stopped_s > allowed:
        found.append(f"the other arm was told after {outcome.other_stopped_s} s, {allowed} s are allowed")
    if outcome.ended_s is None or outcome.ended_s > allowed + 2:
        found.append(f"the program ended after {outcome.ended_s} s")
    if not re.search(WORDS[trial.fault], outcome.error) or trial.arm not in outcome.error:
        found.append(f"the reason is {outcome.error!r}")
    needs_halt = trial.phase == "moving" and trial.fault not in ("lie",)
    if needs_halt and (outcome.faulty_halted_s is None or outcome.faulty_halted_s > allowed + WATCHDOG_S):
        found.append(f"the arm itself came to rest after {outcome.faulty_halted_s} s")
    return found
