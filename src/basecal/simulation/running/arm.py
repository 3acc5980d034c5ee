"""A moving arm: its commanded joints, its encoder readings, and the true pose of its flange."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from basecal.errors import InputError
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3, Array
from basecal.kinematics import SerialChain
from basecal.simulation.running.faults import Faults

_FASTEST_RAD_S = np.pi  # joint speed of a UR5e
_ACCELERATION_RAD_S2 = 8.0  # of a fast move
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735  # of a quintic from rest to rest of unit length and duration
_STOP_DURATION_S = 0.15
_REPEATABILITY_RAD = 3e-5  # of each joint at each stop: 0.03 mm at the flange
_RINGING_S = 0.5
_RINGING_HZ = 9.0  # natural frequency of an extended arm


@dataclass(frozen=True, eq=False)
class Leg:
    """A movement from rest to rest.

    Attributes:
        begin_s: Start time [s].
        duration_s: Duration [s].
        start: (n,) joints at the start [rad].
        goal: (n,) joints at the end [rad].
        side_before: (n,) side of the backlash on which each joint rests before the movement, -1 or 1.
        error_before: (n,) positioning errors of the joints before the movement [rad].
        error: (n,) positioning errors of the joints after the movement [rad].
    """

    begin_s: float
    duration_s: float
    start: Array
    goal: Array
    side_before: Array
    error_before: Array
    error: Array

    @property
    def side(self) -> Array:
        """Side of the backlash on which each joint comes to rest, (n,); unchanged for a joint that does not move."""
        moved = self.goal - self.start
        return np.where(np.abs(moved) > 1e-9, np.sign(moved), self.side_before)

    def rest(self, share: float) -> tuple[Array, Array]:
        """Side of the backlash and positioning error [rad] of each joint, (n,), after a share of the movement."""
        ends = (self.side_before, self.side), (self.error_before, self.error)
        side, error = (previous + share * (final - previous) for previous, final in ends)
        return side, error

    def share(self, now_s: float) -> float:
        """Completed share of the movement, 0 to 1: a quintic with zero speed and acceleration at both ends."""
        done = float(np.clip((now_s - self.begin_s) / self.duration_s, 0.0, 1.0)) if self.duration_s > 0 else 1.0
        return done**3 * (10 - 15 * done + 6 * done**2)


class RunningArm:
    """A simulated arm that can be moved.

    Attributes:
        moves: Number of moves so far.
    """

    def __init__(self, name: str, kinematics: Kinematics, home: Array, faults: Faults, seed: int) -> None:
        self.moves = 0
        self._name, self._kinematics, self._faults, self._seed = name, kinematics, faults, seed
        self._reading_count = 0
        self._leg = Leg(0.0, 0.0, home, home, np.ones(len(home)), np.zeros(len(home)), self._positioning_error(home))

    def move(self, joints: Array, speed_rad_s: float, now_s: float) -> None:
        """Start a movement from the current joints to a goal, (n,) [rad].

        Raises:
            InputError: if the goal is beyond the limits, or has the wrong number of joints.
        """
        chain = self._kinematics.chain
        if joints.shape != (chain.n,) or not np.all((joints >= chain.lower) & (joints <= chain.upper)):
            raise InputError(
                f"{self._name} has {chain.n} joints within {chain.lower} to {chain.upper} rad, got {joints}"
            )
        if not speed_rad_s > 0:
            raise InputError(f"speed_rad_s is {speed_rad_s}, expected a number above 0")
        travel_rad = float(np.abs(joints - self.commanded_joints(now_s)).max())
        speed = min(speed_rad_s, _FASTEST_RAD_S)
        duration_s = max(
            _PEAK_SPEED * travel_rad / speed, float(np.sqrt(_PEAK_ACCELERATION * travel_rad / _ACCELERATION_RAD_S2))
        )
        self._start_motion(joints, duration_s, now_s)
        self.moves += 1

    def stop(self, now_s: float) -> None:
        """Decelerate to rest on the current path."""
        if now_s < self._leg.begin_s + self._leg.duration_s:
            self._start_motion(self.commanded_joints(now_s + 0.5 * _STOP_DURATION_S), _STOP_DURATION_S, now_s)

    def _start_motion(self, joints: Array, duration_s: float, now_s: float) -> None:
        rest = self._leg.rest(self._leg.share(now_s))
        self._leg = Leg(now_s, duration_s, self.commanded_joints(now_s), joints, *rest, self._positioning_error(joints))
        self._reading_count = 0

    @property
    def goal(self) -> Array:
        """Goal of the current movement, (n,) [rad]."""
        return self._leg.goal

    @property
    def arrival_s(self) -> float:
        """Time at which the current movement ends [s]."""
        return self._leg.begin_s + self._leg.duration_s

    def commanded_joints(self, now_s: float) -> Array:
        """Joints commanded by the controller, (n,) [rad]."""
        leg = self._leg
        return leg.start + leg.share(now_s) * (leg.goal - leg.start)

    def reported_joints(self, now_s: float) -> Array:
        """Encoder readings, (n,) [rad]; their noise depends on the number of queries since the movement started."""
        self._reading_count += 1
        noise = self._faults.size("encoder-noise")
        commanded = self.commanded_joints(now_s)
        return commanded + noise * self._draw_normal(self._leg.goal, self._reading_count) if noise else commanded

    @property
    def chain(self) -> SerialChain:
        """The stated chain."""
        return self._kinematics.chain

    def base_from_flange(self, now_s: float) -> SE3:
        """True pose of the flange in the base."""
        return self._kinematics.forward(self._true_joints(now_s)[None])[0]

    def joint_frames(self, now_s: float) -> SE3:
        """`base_from_joint` of each joint for rendering, with the stated links."""
        return self.chain.joint_frames(self._true_joints(now_s))

    def _true_joints(self, now_s: float) -> Array:
        share = self._leg.share(now_s)
        side, error = self._leg.rest(share)
        play = 0.5 * self._faults.size("backlash") * side
        return self.commanded_joints(now_s) + play + error + self._ringing(now_s) + self._following_error(share)

    def _ringing(self, now_s: float) -> Array:
        """Ringing of the joints after arrival, (n,) [rad]: it decays to zero in half a second."""
        since_s = now_s - self._leg.begin_s - self._leg.duration_s
        size = self._faults.size("ringing")
        if not size or not 0 < since_s < _RINGING_S or not self._leg.duration_s:
            return np.zeros_like(self._leg.goal)
        swing_rad = size * (1 - since_s / _RINGING_S) * np.cos(2 * np.pi * _RINGING_HZ * since_s)
        return np.full_like(self._leg.goal, swing_rad)

    def _following_error(self, share: float) -> Array:
        """Following errors of the joints, (n,) [rad], largest in the middle of a movement."""
        size = self._faults.size("following-error") * 4 * share * (1 - share)
        return size * self._draw_normal(self._leg.goal, -1) if size else np.zeros_like(self._leg.goal)

    def _positioning_error(self, joints: Array) -> Array:
        return _REPEATABILITY_RAD * self._draw_normal(joints, 0)

    def _draw_normal(self, joints: Array, number: int) -> Array:
        """Normal random numbers, one per joint, that depend only on the goal and a number."""
        goal = np.round(joints, 9) + 0.0
        return seeded_generator(self._seed, self._name, number, goal.tolist()).standard_normal(len(joints))


def seeded_generator(*words: Any) -> np.random.Generator:
    """A random number generator whose seed is a hash of the arguments."""
    hashed = hashlib.sha256(repr(words).encode()).digest()
    return np.random.default_rng(np.frombuffer(hashed, dtype=np.uint32))
