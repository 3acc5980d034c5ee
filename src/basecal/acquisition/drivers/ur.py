"""Universal Robots' controllers, over RTDE by ur-rtde: states with the controller's stamps, moves, leading by hand.

States need only port 30004. Moves and freedrive run a program on the controller, which is sent there when the first of
them is asked for; that needs remote control, the dashboard (29999) and the ports for programs.
"""

from __future__ import annotations

from basecal.acquisition.driver import Place, Reading, checked_options
from basecal.acquisition.ur.options import UrOptions
from basecal.acquisition.ur.program import Program
from basecal.acquisition.ur.receiver import Receiver
from basecal.cell import RobotState
from basecal.errors import DatasetError, DriverError
from basecal.exchange.controllers.convention import convention

_JOINTS = 6
_STOP_RAD_S2 = 2.0  # of each joint when it is told to stop: from 30 deg/s it takes a quarter of a second
_FASTEST_RAD_S = 3.14  # that ur-rtde takes for a joint
_BEYOND = "where it is sent is beyond its safety limits"
_NOT_TAKEN = "the controller did not take the move"


class UrWatched:
    """A controller whose states are read; a person moves it, or another program."""

    is_live = True

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def state(self) -> Reading:
        """Its next state, with the controller's stamp: seconds since it was switched on.

        Raises:
            DriverError: if it stands in a protective or emergency stop, or no state comes, though tried again.
        """
        return self._receiver.state()

    def close(self) -> None:
        """Hang up; the arm stays where it is."""
        self._receiver.close()


class UrMoved:
    """A controller that is sent to places."""

    is_live = True

    def __init__(self, name: str, receiver: Receiver, program: Program, acceleration_rad_s2: float) -> None:
        self._name, self._receiver, self._program = name, receiver, program
        self._acceleration_rad_s2 = acceleration_rad_s2

    def state(self) -> Reading:
        """As `UrWatched.state`."""
        return self._receiver.state()

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Begin to go there, the leading joint at this speed, or at the fastest that ur-rtde allows.

        Raises:
            DriverError: if it is beyond the safety limits, or the controller does not take it.
        """
        how = (min(speed_rad_s, _FASTEST_RAD_S), self._acceleration_rad_s2, True)
        if to.joints_rad is not None:
            joints = to.joints_rad.tolist()
            self._check(self._program.ask(lambda line: line.isJointsWithinSafetyLimits(joints)), _BEYOND)
            self._check(self._program.ask(lambda line: line.moveJ(joints, *how)), _NOT_TAKEN)
        elif to.base_from_flange is not None:
            pose = convention("ur").written(to.base_from_flange).tolist()
            self._check(self._program.ask(lambda line: line.isPoseWithinSafetyLimits(pose)), _BEYOND)
            self._check(self._program.ask(lambda line: line.moveJ_IK(pose, *how)), _NOT_TAKEN)

    def _check(self, is_well: bool, why: str) -> None:
        if not is_well:
            raise DriverError(f"{self._name}: {why}; look at the pendant's log")

    def stop(self) -> None:
        """Stand still; where nothing was moved there is nothing to stop."""
        if self._program.was_asked:
            self._program.ask(lambda line: line.stopJ(_STOP_RAD_S2))

    def close(self) -> None:
        """End the program, and hang up."""
        self._program.close()
        self._receiver.close()


class UrLed:
    """A controller whose arm a person leads."""

    is_live = True

    def __init__(self, name: str, receiver: Receiver, program: Program) -> None:
        self._name, self._receiver, self._program = name, receiver, program

    def state(self) -> Reading:
        """As `UrWatched.state`."""
        return self._receiver.state()

    def freedrive(self, on: bool) -> None:
        """Let the arm be led, or hold it.

        Raises:
            DriverError: if the controller does not take it.
        """
        if not self._program.ask(lambda line: line.freedriveMode() if on else line.endFreedriveMode()):
            word = "begin" if on else "end"
            raise DriverError(f"{self._name}: the controller did not {word} freedrive; look at the pendant's log")

    def close(self) -> None:
        """End the program, and hang up."""
        self._program.close()
        self._receiver.close()


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
        raise DatasetError(str(place.folder / "cell.yaml"), message, field=f"robots.{place.name}.urdf")
    receiver, program = Receiver(place.name, options, chain is not None), Program(place.name, options)
    if options.motion == "watch":
        return UrWatched(receiver)
    if options.motion == "freedrive":
        return UrLed(place.name, receiver, program)
    return UrMoved(place.name, receiver, program, options.acceleration_rad_s2)
