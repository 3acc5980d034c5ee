"""Neighbourhoods of robots in a large cell: a robot and all devices that share views with it.

The views of a robot contain nearly all information on its noise and on its camera's noise. Matrices of the whole cell
grow with the square of the number of robots.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.least_squares.sparse_normal_equations import MANY_COLUMNS
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.robot_noise import some_views
from basecal.estimation.problem.problem import Problem, State, sequential_columns
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array

# Maximum number of views of each pair of camera and target: the pairs of a robot determine a sigma to a few %; assumed.
_MOST_VIEWS = 200


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """A robot and the devices that share views with it.

    Attributes:
        robot: Name of the robot.
        problem: Problem with the robot's views alone and its base fixed.
        state: The state for these views.
        cameras: Cameras whose noise is reported here.
        targets: Targets whose shape is reported here.
    """

    robot: str
    problem: Problem
    state: State
    cameras: frozenset[str]
    targets: frozenset[str]


def uses_neighbourhoods(problem: Problem) -> bool:
    """Whether a problem has enough unknowns and robots to estimate its sigmas by neighbourhoods."""
    return problem.width >= MANY_COLUMNS and not problem.models and len(problem.robots) > 1


def neighbourhoods(problem: Problem, state: State) -> Iterator[Neighbourhood]:
    """Yield each robot's neighbourhood; a camera or target is reported by its carrier, or by a robot that shares views.

    The reporting robot of a static camera or target is that of its first group of views.
    """
    carrier = {group.camera: group.eye.robot or group.hand.robot for group in reversed(problem.groups)}
    holder = {group.target: group.hand.robot or group.eye.robot for group in reversed(problem.groups)}
    for robot in problem.robots:
        own_problem, own_state = some_views(
            problem.with_groups(g for g in problem.groups if g.robot_end(robot)), state, _MOST_VIEWS
        )
        base = next((end.base for end in own_problem.robot_ends(robot)), None)  # None for the reference
        yield Neighbourhood(
            robot,
            replace(own_problem, columns=_columns(own_problem, base)),
            own_state,
            frozenset(name for name, reporter in carrier.items() if reporter == robot),
            frozenset(name for name, reporter in holder.items() if reporter == robot),
        )


def merge_estimates(estimates: Mapping[str, NoiseEstimate], parts: Mapping[str, Neighbourhood]) -> NoiseEstimate:
    """Merge the estimates of all neighbourhoods; each sigma and shape is taken from the neighbourhood that reports it.

    A robot's sigma is its posterior root mean square. With few views, the most likely value would make the result look
    too certain.
    """
    variances = {
        robot: each.robot_variances[robot] for robot, each in estimates.items() if robot in each.robot_variances
    }
    cameras: dict[str, Noise] = {}
    shapes: dict[str, tuple[Array, Array]] = {}
    for robot, each in parts.items():
        cameras |= {name: noise for name, noise in estimates[robot].cameras.items() if name in each.cameras}
        shapes |= {name: shape for name, shape in estimates[robot].shapes.items() if name in each.targets}
    return NoiseEstimate(
        next(iter(cameras.values()), Noise()),
        1.0,
        tuple(f for f in Noise._fields if any(f in each.estimated for each in estimates.values())),
        all(each.converged for each in estimates.values()),
        {robot: np.sqrt(each) for robot, each in variances.items()},
        cameras,
        minus_2_log_evidence=sum(each.minus_2_log_evidence for each in estimates.values()),
        plain_minus_2_log_evidence=sum(each.plain_minus_2_log_evidence for each in estimates.values()),
        shapes=shapes,
        robot_variances=variances,
    )


def _columns(problem: Problem, held_base: str | None) -> dict[str, slice]:
    """Columns of the unknowns that the problem's views depend on, without those of one base."""
    names: set[str | None] = set()
    for group in problem.groups:
        names |= {*group.frames, group.camera}
    names.discard(held_base)
    return sequential_columns({name: problem.column_width(name) for name in problem.columns if name in names})
