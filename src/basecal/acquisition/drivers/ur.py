"""Universal Robots' controllers over RTDE with ur-rtde: states with the controller's timestamps, moves, freedrive.

States need only port 30004. Moves and freedrive run a program on the controller, which is sent at the first request.
This needs remote control, the dashboard (29999) and the ports for programs. The controller's watchdog ends the program,
and with it any motion, if this computer is silent for a third of a second.
"""

from __future__ import annotations

import time

from basecal.acquisition.driver import Place, Reading, StopGuarantee, checked_options
from basecal.acquisition.ur.options import UrOptions
from basecal.acquisition.ur.program import Program
from basecal.acquisition.ur.receiver import Receiver
from basecal.cell import RobotState
from basecal.errors import DriverError, count_text
from basecal.exchange.controllers.registry import CONTROLLERS

STOP_GUARANTEE: StopGuarantee = "watchdog"

_JOINTS = 6
_FASTEST_RAD_S = 3.14  # largest joint speed that ur-rtde accepts
_BEYOND_LIMITS = "the goal is beyond the safety limits of the controller"
_STOPPED_STATES = 10  # consecutive states without a running program after which it counts as stopped
_SILENCE_S = 0.1  # without heartbeats, after which a stop by the watchdog is intended; they are sent every 20 ms


class UrWatched:
    """A controller that is only read; a person or another program moves the arm."""

    is_live = True

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver

    @property
    def is_connected(self) -> bool:
        """Whether the connection for states is open."""
        return self._receiver.is_connected

    def state(self) -> Reading:
        """Return the robot's next state, with the controller's timestamp [s since its start].

        Raises:
            DriverError: if the controller is in a safety stop, or no state arrives before the timeout.
        """
        return self._receiver.state()

    def close(self) -> None:
        """Close the connection, without a motion."""
        self._receiver.close()


class _WithProgram(UrWatched):
    """A controller that runs the program of ur-rtde, and stops the arm if this computer is silent."""

    def __init__(self, name: str, receiver: Receiver, program: Program) -> None:
        super().__init__(receiver)
        self._name, self._program = name, program
        self._stopped_states = 0
        self._heartbeat_s = float("-inf")

    @property
    def is_connected(self) -> bool:
        """Whether the connection for states is open, and that of the program was never lost."""
        return self._receiver.is_connected and self._program.is_connected

    def state(self) -> Reading:
        """Return the robot's next state, as `UrWatched.state` does.

        Raises:
            DriverError: also if the program on the controller was stopped although heartbeats are sent.
        """
        was_sent = self._program.was_sent
        reading = self._receiver.state()
        self._stopped_states = self._stopped_states + 1 if was_sent and not self._receiver.is_program_running else 0
        if self._stopped_states >= _STOPPED_STATES and time.monotonic() - self._heartbeat_s < _SILENCE_S:
            raise DriverError(
                f"{self._name}: the program on the controller was stopped, by a person or by its watchdog"
            )
        return reading

    def keep_alive(self) -> None:
        """Send a heartbeat to the controller's watchdog."""
        self._heartbeat_s = float("inf")  # a call that hangs is no silence
        try:
            self._program.keep_alive()
        finally:
            self._heartbeat_s = time.monotonic()

    def close(self) -> None:
        """End the program, and close the connection."""
        self._program.close()
        self._receiver.close()

    def _check(self, is_accepted: bool, action: str) -> None:
        if not is_accepted:
            raise DriverError(f"{self._name}: the controller did not {action}; look at the pendant's log")


class UrMoved(_WithProgram):
    """A controller whose arm is moved by program."""

    def __init__(self, name: str, receiver: Receiver, program: Program, acceleration_rad_s2: float) -> None:
        super().__init__(name, receiver, program)
        self._acceleration_rad_s2 = acceleration_rad_s2

    def goal_refusal(self, to: RobotState) -> str:
        """The controller's reason to refuse a goal; empty if it accepts the goal.

        Raises:
            DriverError: if the controller does not answer.
        """
        if to.joints_rad is not None:
            joints = to.joints_rad.tolist()
            return (
                ""
                if self._program.ask(lambda interface: interface.isJointsWithinSafetyLimits(joints))
                else _BEYOND_LIMITS
            )
        pose = _rotation_vector_pose(to)
        return "" if self._program.ask(lambda interface: interface.isPoseWithinSafetyLimits(pose)) else _BEYOND_LIMITS

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Start a motion to a goal; the speed of the leading joint is limited to the maximum of ur-rtde.

        Raises:
            DriverError: if the goal is beyond the safety limits, or the controller does not accept the motion.
        """
        if refusal := self.goal_refusal(to):
            raise DriverError(f"{self._name}: {refusal}")
        move_arguments = (min(speed_rad_s, _FASTEST_RAD_S), self._acceleration_rad_s2, True)
        if to.joints_rad is not None:
            joints = to.joints_rad.tolist()
            self._check(self._program.ask(lambda interface: interface.moveJ(joints, *move_arguments)), "take the move")
        else:
            pose = _rotation_vector_pose(to)
            self._check(self._program.ask(lambda interface: interface.moveJ_IK(pose, *move_arguments)), "take the move")

    def stop(self) -> None:
        """Stop the arm; do nothing before the first motion.

        Raises:
            DriverError: if the controller does not accept the stop.
        """
        self._program.stop(self._receiver.is_connected)


class UrHandGuided(_WithProgram):
    """A controller whose arm a person leads."""

    def freedrive(self, on: bool) -> None:
        """Switch freedrive on or off.

        Raises:
            DriverError: if the controller does not accept the command.
        """
        is_accepted = self._program.ask(
            lambda interface: interface.freedriveMode() if on else interface.endFreedriveMode()
        )
        self._check(is_accepted, f"{'begin' if on else 'end'} freedrive")


def _rotation_vector_pose(to: RobotState) -> list[float]:
    """A pose in the convention of UR controllers: position [m] and rotation vector [rad]."""
    assert to.base_from_flange is not None
    return [float(number) for number in CONTROLLERS["ur"].to_numbers(to.base_from_flange)]


def reaches(place: Place) -> str:
    """Description of the controller.

    Raises:
        DatasetError: if an option is wrong.
    """
    return f"the UR controller at {checked_options(place, UrOptions).host}"


def open_robot(place: Place) -> UrWatched | UrMoved | UrHandGuided:
    """Connect to a controller; states are joints if the cell has a URDF, else poses of the tool centre point.

    Raises:
        DatasetError: if an option is wrong, or the URDF does not have six joints.
        DriverError: if the controller does not answer.
        MissingExtra: if ur-rtde is not installed.
    """
    options = checked_options(place, UrOptions)
    chain = place.cell.robots[place.name].chain
    if chain is not None and len(chain.joint_names) != _JOINTS:
        message = f"{count_text(len(chain.joint_names), 'joint')} from base_link to flange_link, but a UR has {_JOINTS}"
        raise place.error(message, "urdf")
    receiver, program = Receiver(place.name, options, chain is not None), Program(place.name, options)
    if options.motion == "watch":
        return UrWatched(receiver)
    if options.motion == "freedrive":
        return UrHandGuided(place.name, receiver, program)
    return UrMoved(place.name, receiver, program, options.acceleration_rad_s2)
