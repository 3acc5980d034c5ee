"""The samples of a plan as paths of robots with times of arrival, for all output formats."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from basecal.cell import Cell, Robot, RobotState, Sample
from basecal.errors import FrameNotFound, InputError
from basecal.geometry import SE3, Array

_LONGEST_TURN_RAD = np.pi  # assumed largest joint motion to the first pose
_PEAK_RATIO = 1.5  # ratio of peak to mean speed of a cubic from rest to rest


@dataclass(frozen=True, eq=False)
class RobotPath:
    """Planned path of robots from sample to sample.

    Attributes:
        robots: The moving robots by name.
        samples: The samples, each with the states of all these robots.
        speed_rad_s: Largest joint speed [rad/s].
        hold_s: Time at rest at each sample [s].
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
        """Return the only robot of the path.

        Raises:
            InputError: if there are several: a controller's program moves only its own arm.
        """
        if len(self.robots) != 1:
            raise InputError(f"a program is for one robot: choose one with --robot: {', '.join(self.robots)}")
        return next(iter(self.robots))

    def has_joints(self, robot: str) -> bool:
        """Whether all samples have the joints of a robot."""
        return all(sample.robots[robot].joints_rad is not None for sample in self.samples)

    def joints(self, robot: str) -> Array:
        """Return the joints of a robot at the samples, (n, joints) [rad].

        Raises:
            InputError: if the robot is planned with poses.
        """
        width = len(self.joint_names(robot))
        return np.array([sample.robots[robot].joints_rad for sample in self.samples]).reshape(-1, width)

    def joint_names(self, robot: str) -> tuple[str, ...]:
        """Return the names of a robot's joints.

        Raises:
            InputError: if the robot is planned with poses.
        """
        chain = self.robots[robot].chain
        if chain is None or not self.has_joints(robot):
            raise InputError(
                f"{robot} is planned with poses, its joints are unknown. Add urdf, base_link and flange_link to "
                "cell.yaml and teach joints, or use `--to csv` or `--to ur-script`"
            )
        return chain.joint_names

    def pose(self, robot: str, sample: Sample) -> SE3:
        """Return the planned flange pose of a robot in its base."""
        state: RobotState = sample.robots[robot]
        if state.base_from_flange is not None:
            return state.base_from_flange
        chain = self.robots[robot].chain
        assert chain is not None
        assert state.joints_rad is not None
        return chain.forward(state.joints_rad)

    @cached_property
    def arrivals_s(self) -> list[float]:
        """Times of arrival of all robots at each sample, from the start [s]; the first motion is assumed to be pi.

        All arms use the time of the slowest, so that trajectories started together stay synchronized.
        """
        largest = np.zeros(max(len(self.samples) - 1, 0))
        for robot in self.robots:
            if self.has_joints(robot):
                largest = np.maximum(largest, np.abs(np.diff(self.joints(robot), axis=0)).max(-1, initial=0.0))
        durations_s = np.array([_LONGEST_TURN_RAD, *largest]) * _PEAK_RATIO / self.speed_rad_s
        return [float(moved_s + k * self.hold_s) for k, moved_s in enumerate(np.cumsum(durations_s))]


@dataclass(frozen=True)
class PlanFormat:
    """An output format of plans.

    Attributes:
        words: Description of the format for help.
        text: Function that returns the text of the file; raises InputError if the format cannot express the plan.
    """

    words: str
    text: Callable[[RobotPath], str]


def make_path(
    cell: Cell, samples: Sequence[Sample], robot: str | None = None, speed_rad_s: float = 0.5, hold_s: float = 2.0
) -> RobotPath:
    """Create the path of robots through samples.

    Args:
        cell: The cell.
        samples: Samples with states of the same robots.
        robot: Name of the robot; all robots of the samples if None.
        speed_rad_s: Largest joint speed [rad/s].
        hold_s: Time at rest at each sample [s].

    Raises:
        FrameNotFound: if the robot does not exist.
    """
    if robot is not None and robot not in cell.robots:
        raise FrameNotFound(robot, list(cell.robots))
    planned = set(cell.robots).intersection(*(sample.robots for sample in samples))
    names = [name for name in cell.robots if name in planned and robot in (None, name)]
    return RobotPath({name: cell.robots[name] for name in names}, tuple(samples), speed_rad_s, hold_s)
