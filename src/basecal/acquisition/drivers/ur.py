"""Universal Robots' controllers, over RTDE by ur-rtde: states with the controller's stamps, moves, leading by hand.

States need only port 30004. Moves and freedrive run a program on the controller, which is sent there when the first of
them is requested. This needs remote control, the dashboard (29999) and the ports for programs. The controller's
watchdog ends that program, and with it any motion, when this computer is silent for a third of a second.
"""

from __future__ import annotations

from basecal.acquisition.driver import Place, Reading, StopGuarantee, checked_options
from basecal.acquisition.ur.options import UrOptions
from basecal.acquisition.ur.program import Program
from basecal.acquisition.ur.receiver import Receiver
from basecal.cell import RobotState
from basecal.errors import DriverError
from basecal.exchange.controllers.registry import CONTROLLERS

STOP_GUARANTEE: StopGuarantee = "watchdog"

_JOINTS = 6
_FASTEST_RAD_S = 3.14  # that ur-rtde takes for a joint
_BEYOND_LIMITS = "the goal is beyond the safety limits of the controller"
_ENDED = 10  # states in a row that say that the program no longer runs, before it counts as stopped


class UrWatched:
    """A controller whose states are read; a person moves it, or another program."""

    is_live = True

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver

    @property
    def is_connected(self) -> bool:
        """Whether the connection that states come over stands."""
        return self._receiver.is_connected

    def state(self) -> Reading:
        """Its next state, with the controller's stamp: seconds since it was switched on.

        Raises:
            DriverError: if it is in any safety stop, or no state comes, though tried again.
        """
        return self._receiver.state()

    def close(self) -> None:
        """Hang up; the arm stays where it is."""
        self._receiver.close()


class _WithProgram(UrWatched):
    """A controller that runs the program of ur-rtde, and stops the arm when this computer is silent."""

    def __init__(self, name: str, receiver: Receiver, program: Program) -> None:
        super().__init__(receiver)
        self._name, self._program = name, program
        self._ended = 0

    def state(self) -> Reading:
        """As `UrWatched.state`.

        Raises:
            DriverError: also if somebody stopped the program.
        """
        was_asked = self._program.was_sent
        reading = self._receiver.state()
        self._ended = self._ended + 1 if was_asked and not self._receiver.is_program_running else 0
        if self._ended >= _ENDED:
            raise DriverError(
                f"{self._name}: the program on the controller was stopped, by a person or by its watchdog"
            )
        return reading

    def keep_alive(self) -> None:
        """Keep the controller's watchdog awake."""
        self._program.keep_alive()

    def close(self) -> None:
        """End the program, and hang up."""
        self._program.close()
        self._receiver.close()

    def _check(self, is_well: bool, action: str) -> None:
        if not is_well:
            raise DriverError(f"{self._name}: the controller did not {action}; look at the pendant's log")


class UrMoved(_WithProgram):
    """A controller that is sent to places."""

    def __init__(self, name: str, receiver: Receiver, program: Program, acceleration_rad_s2: float) -> None:
        super().__init__(name, receiver, program)
        self._acceleration_rad_s2 = acceleration_rad_s2

    def goal_refusal(self, to: RobotState) -> str:
        """Why the controller would not go there, in words; empty if it would.

        Raises:
            DriverError: if it cannot be asked.
        """
        if to.joints_rad is not None:
            joints = to.joints_rad.tolist()
            return "" if self._program.ask(lambda line: line.isJointsWithinSafetyLimits(joints)) else _BEYOND_LIMITS
        pose = _rotation_vector_pose(to)
        return "" if self._program.ask(lambda line: line.isPoseWithinSafetyLimits(pose)) else _BEYOND_LIMITS

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Begin to go there, the leading joint at this speed, or at the fastest that ur-rtde allows.

        Raises:
            DriverError: if it is beyond the safety limits, or the controller does not take it.
        """
        if why := self.goal_refusal(to):
            raise DriverError(f"{self._name}: {why}")
        how = (min(speed_rad_s, _FASTEST_RAD_S), self._acceleration_rad_s2, True)
        if to.joints_rad is not None:
            joints = to.joints_rad.tolist()
            self._check(self._program.ask(lambda line: line.moveJ(joints, *how)), "take the move")
        else:
            pose = _rotation_vector_pose(to)
            self._check(self._program.ask(lambda line: line.moveJ_IK(pose, *how)), "take the move")

    def stop(self) -> None:
        """Stand still; where nothing was moved there is nothing to stop.

        Raises:
            DriverError: if the controller does not take it.
        """
        self._program.stop()


class UrLed(_WithProgram):
    """A controller whose arm a person leads."""

    def freedrive(self, on: bool) -> None:
        """Let the arm be led, or hold it.

        Raises:
            DriverError: if the controller does not take it.
        """
        is_taken = self._program.ask(lambda line: line.freedriveMode() if on else line.endFreedriveMode())
        self._check(is_taken, f"{'begin' if on else 'end'} freedrive")


def _rotation_vector_pose(to: RobotState) -> list[float]:
    """A pose as UR controllers take it."""
    assert to.base_from_flange is not None
    return [float(number) for number in CONTROLLERS["ur"].to_numbers(to.base_from_flange)]


def reaches(place: Place) -> str:
    """The controller.

    Raises:
        DatasetError: if an option is wrong.
    """
    return f"the UR controller at {checked_options(place, UrOptions).host}"


def open_robot(place: Place) -> UrWatched | UrMoved | UrLed:
    """A controller; it gives joints where the cell has its URDF, else the pose of its tool centre point.

    Raises:
        DatasetError: if an option is wrong, or the URDF is not of a robot with six joints.
        DriverError: if the controller does not answer.
        MissingExtra: if ur-rtde is not installed.
    """
    options = checked_options(place, UrOptions)
    chain = place.cell.robots[place.name].chain
    if chain is not None and len(chain.joint_names) != _JOINTS:
        message = f"{len(chain.joint_names)} joints from base_link to flange_link, but a UR has {_JOINTS}"
        raise place.error(message, "urdf")
    receiver, program = Receiver(place.name, options, chain is not None), Program(place.name, options)
    if options.motion == "watch":
        return UrWatched(receiver)
    if options.motion == "freedrive":
        return UrLed(place.name, receiver, program)
    return UrMoved(place.name, receiver, program, options.acceleration_rad_s2)
