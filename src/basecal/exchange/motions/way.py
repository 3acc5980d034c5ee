"""The samples of a plan as the ways of robots, and when each is where: what all kinds of output need."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from basecal.cell import Cell, Robot, RobotState, Sample
from basecal.errors import FrameNotFound, InputError
from basecal.geometry import SE3, Array

_LONGEST_TURN_RAD = np.pi  # to the first pose, from wherever the arm is
_PEAK = 1.5  # the fastest of a cubic from rest to rest, to its mean speed


@dataclass(frozen=True, eq=False)
class Way:
    """Where robots shall be, one sample after another.

    Attributes:
        robots: The robots that are sent, by name.
        samples: The samples; each says where all of them shall be.
        speed_rad_s: The fastest that any joint may turn.
        hold_s: How long all stand still at each sample.
    """

    robots: Mapping[str, Robot]
    samples: tuple[Sample, ...]
    speed_rad_s: float
    hold_s: float

    @property
    def numbers(self) -> list[int]:
        """Numbers of the samples."""
        return [sample.sample for sample in self.samples]

    def single_robot(self) -> str:
        """The one robot that is sent.

        Raises:
            InputError: if there are several: a controller runs a program for its own arm.
        """
        if len(self.robots) != 1:
            raise InputError(f"a program is of one robot: say whose with --robot: {', '.join(self.robots)}")
        return next(iter(self.robots))

    def has_joints(self, robot: str) -> bool:
        """Whether all samples say the joints of a robot."""
        return all(sample.robots[robot].joints_rad is not None for sample in self.samples)

    def joints(self, robot: str) -> Array:
        """(n, joints) of a robot [rad].

        Raises:
            InputError: if it is known by poses alone.
        """
        width = len(self.joint_names(robot))
        return np.array([sample.robots[robot].joints_rad for sample in self.samples]).reshape(-1, width)

    def joint_names(self, robot: str) -> tuple[str, ...]:
        """Names of the joints of a robot.

        Raises:
            InputError: if it is known by poses alone.
        """
        chain = self.robots[robot].chain
        if chain is None or not self.has_joints(robot):
            raise InputError(
                f"{robot} is planned by poses, its joints are not known. Add urdf, base_link and flange_link to "
                "cell.yaml and teach poses by joints, or take `--to csv` or `--to ur-script`"
            )
        return chain.joint_names

    def pose(self, robot: str, sample: Sample) -> SE3:
        """Where the flange of a robot shall be in its base."""
        state: RobotState = sample.robots[robot]
        if state.base_from_flange is not None:
            return state.base_from_flange
        chain = self.robots[robot].chain
        assert chain is not None
        assert state.joints_rad is not None
        return chain.forward(state.joints_rad)

    @cached_property
    def arrivals_s(self) -> list[float]:
        """Times of arrival of all robots at each sample, from the start [s]; the way to the first is half a turn long.

        All arms take the time of the slowest, so that trajectories that begin together stay in step.
        """
        largest = np.zeros(max(len(self.samples) - 1, 0))
        for robot in self.robots:
            if self.has_joints(robot):
                largest = np.maximum(largest, np.abs(np.diff(self.joints(robot), axis=0)).max(-1, initial=0.0))
        ways = np.array([_LONGEST_TURN_RAD, *largest]) * _PEAK / self.speed_rad_s
        return [float(way + k * self.hold_s) for k, way in enumerate(np.cumsum(ways))]


@dataclass(frozen=True)
class Motion:
    """A way to write where a plan sends the arms.

    Attributes:
        words: What it gives, for help.
        text: Writes the file; raises an InputError if it cannot say it.
    """

    words: str
    text: Callable[[Way], str]


def make_way(
    cell: Cell, samples: Sequence[Sample], robot: str | None = None, speed_rad_s: float = 0.5, hold_s: float = 2.0
) -> Way:
    """The samples as ways.

    Args:
        cell: The cell.
        samples: Each with a state of the same robots.
        robot: Which robot; all that the samples move where None.
        speed_rad_s: See `Way`.
        hold_s: See `Way`.

    Raises:
        FrameNotFound: if there is no such robot.
    """
    if robot is not None and robot not in cell.robots:
        raise FrameNotFound(robot, list(cell.robots))
    said = set(cell.robots).intersection(*(sample.robots for sample in samples))
    names = [name for name in cell.robots if name in said and robot in (None, name)]
    return Way({name: cell.robots[name] for name in names}, tuple(samples), speed_rad_s, hold_s)
