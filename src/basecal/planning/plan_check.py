"""Safety check of a whole plan before any robot moves, with the speed of each path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.planning.clearance import Clearance, clearances, path_m_per_rad
from basecal.planning.feasible import reach_pose
from basecal.planning.sketch import Sketch

GoalCheck = Callable[[RobotState], str]
"""Function of a goal that returns the controller's reason to refuse it; empty if it accepts the goal."""

_LIMIT_ROUNDING_RAD = 1e-9  # excess over a joint limit that is rounding
_LARGEST_TURN_RAD = 4.1 * np.pi  # of a joint on one path: the joint range of a usual arm, rounded up
_LARGEST_REACH_FACTOR = (
    3.0  # at most 2.5 reaches of the data sheet, found by search over paths of arms with six and seven axes
)
_LOAD_M = 0.3  # size of what an arm carries beyond its flange


@dataclass(frozen=True)
class SpeedLimits:
    """Speed limits of any joint [rad/s], and of any point of an arm and its load [m/s]."""

    joint_rad_s: float
    tool_m_s: float


@dataclass(frozen=True)
class RobotPath:
    """Path of one robot to one sample.

    Attributes:
        sample: Number of the sample.
        robot: Name of the robot.
        joint_rad_s: Speed of the leading joint [rad/s].
        tool_m_s: Speed of the robot's fastest point, or an upper bound of it [m/s].
        gaps: Clearances to other robots and to boxes, if known.
    """

    sample: int
    robot: str
    joint_rad_s: float
    tool_m_s: float
    gaps: tuple[Clearance, ...] = ()


@dataclass(frozen=True)
class Refusal:
    """Reason to refuse a plan: the sample, the problem, and what to do."""

    sample: int
    what: str
    do: str

    def __str__(self) -> str:
        return f"sample {self.sample}: {self.what}. {self.do}."


@dataclass(frozen=True)
class PlanCheck:
    """Result of the check of a plan: all paths and all refusals."""

    paths: tuple[RobotPath, ...]
    refusals: tuple[Refusal, ...]


def check_plan(
    sketch: Sketch,
    home: Mapping[str, RobotState],
    plan: Sequence[Sample],
    limits: SpeedLimits,
    goal_checks: Mapping[str, GoalCheck],
) -> PlanCheck:
    """Check every sample of a plan and every path between consecutive samples; the first path begins at `home`.

    Args:
        sketch: The cell.
        home: Current states of the robots, by name.
        plan: Samples in their order.
        limits: Speed limits.
        goal_checks: Functions that ask the controllers of moving robots, by name; other robots do not move.
    """
    paths, refusals = list[RobotPath](), list[Refusal]()
    stops = accumulate(plan, _next_stop, initial=Sample(0, robots=dict(home)))
    for goal, (start, end) in zip(plan, pairwise(stops), strict=True):
        moving = [name for name in goal.robots if name in goal_checks]
        state_refusals = [
            refusal
            for name in moving
            for refusal in _state_refusals(sketch, start.robots[name], end, name, goal_checks[name])
        ]
        refusals += state_refusals
        if not state_refusals:
            gaps = list(clearances(sketch, start, end, moving))
            refusals += _path_refusals(end, gaps)
            paths += [timed_path(sketch, start, end, name, limits, gaps) for name in moving]
    return PlanCheck(tuple(paths), tuple(refusals))


def _next_stop(stop: Sample, goal: Sample) -> Sample:
    """The states of all robots at the next sample; a robot without a goal stays where it is."""
    return Sample(goal.sample, robots={**stop.robots, **goal.robots})


def timed_path(
    sketch: Sketch, start: Sample, end: Sample, robot: str, limits: SpeedLimits, gaps: Sequence[Clearance] = ()
) -> RobotPath:
    """Path of a robot between two samples at the largest speed that satisfies both limits.

    If a robot is sent to poses, its joints are unknown. Its speed is bounded: no point moves by more than three times
    the robot's reach while its leading joint turns by one radian. An unstated reach is estimated from the poses.
    """
    m_per_rad = path_m_per_rad(sketch, start, end, robot)
    if m_per_rad is None:
        positions = [sketch.base_from_flange(robot, each.robots[robot]).translation for each in (start, end)]
        reach_m = sketch.cell.robots[robot].reach_m or max(float(np.linalg.norm(position)) for position in positions)
        m_per_rad = _LARGEST_REACH_FACTOR * (reach_m + _LOAD_M)
    speed = min(limits.joint_rad_s, limits.tool_m_s / m_per_rad) if m_per_rad else limits.joint_rad_s
    gaps_of_robot = tuple(gap for gap in gaps if robot in (gap.robot, gap.other))
    return RobotPath(end.sample, robot, speed, speed * m_per_rad, gaps_of_robot)


def _state_refusals(sketch: Sketch, start: RobotState, end: Sample, robot: str, goal_check: GoalCheck) -> list[Refusal]:
    state, chain = end.robots[robot], sketch.cell.robots[robot].chain
    if state.joints_rad is not None and chain is not None:
        excess_rad = np.maximum(chain.lower - state.joints_rad, state.joints_rad - chain.upper)
        worst = int(np.argmax(excess_rad))
        if not excess_rad[worst] <= _LIMIT_ROUNDING_RAD:  # NaN, too
            name, value = chain.joint_names[worst], state.joints_rad[worst]
            bounds = f"{chain.lower[worst]:.4g} to {chain.upper[worst]:.4g} rad"
            problem = f"joint {name} of {robot} is {value:.4g} rad, but its limits are {bounds}"
            return [Refusal(end.sample, problem, "Change the plan, or the limits in the URDF if they are wrong")]
    if state.joints_rad is not None and start.joints_rad is not None:
        travel_rad = float(np.abs(state.joints_rad - start.joints_rad).max())
        if not travel_rad <= _LARGEST_TURN_RAD:  # a continuous joint has no limits
            problem = f"a joint of {robot} would turn by {travel_rad:.4g} rad, more than two turns"
            return [Refusal(end.sample, problem, "State joints in rad, within two turns of the sample before")]
    pose = state.base_from_flange
    if pose is not None and reach_pose(sketch.cell.robots[robot], pose, start) is None:
        return [Refusal(end.sample, f"{robot} does not reach the pose", "Bring the pose nearer to its base")]
    why = goal_check(state)
    return [Refusal(end.sample, f"{robot}: {why}", "Change the plan, or the limits on its controller")] if why else []


def _path_refusals(end: Sample, gaps: Sequence[Clearance]) -> list[Refusal]:
    return [
        Refusal(
            end.sample,
            f"{gap.robot} comes within {1e3 * max(gap.gap_m, 0.0):.0f} mm of {gap.other!r} on its way, "
            f"{1e3 * gap.needed_m:.0f} mm are required",
            "Leave it out, or go around it",
        )
        for gap in gaps
        if not gap.is_enough
    ]
