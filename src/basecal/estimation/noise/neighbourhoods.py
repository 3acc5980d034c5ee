"""A cell of many robots as the neighbourhoods of each: it, and all that sees it or that it sees.

What its own views say of a robot's noise, and of its camera's, is nearly all that there is to know of these. All
together they take matrices that grow with the square of the robots.
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

# Of each camera and target: a robot is in several, whose freedoms tell a sigma to a few in a hundred; assumed.
_MOST_VIEWS = 200


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """A robot and what it shares views with.

    Attributes:
        robot: Its name.
        problem: Its views alone, its base held.
        state: The state of them.
        cameras: Those whose noise is reported here.
        targets: Those whose shape is.
    """

    robot: str
    problem: Problem
    state: State
    cameras: frozenset[str]
    targets: frozenset[str]


def goes_by_neighbourhoods(problem: Problem) -> bool:
    """Whether a problem has so many unknowns that sigmas are estimated by neighbourhoods."""
    return problem.width >= MANY_COLUMNS and not problem.models and len(problem.robots) > 1


def neighbourhoods(problem: Problem, state: State) -> Iterator[Neighbourhood]:
    """The neighbourhood of each robot; a camera or target is in its carrier's, or in the first that shares a view."""
    carrier = {group.camera: group.eye.robot or group.hand.robot for group in reversed(problem.groups)}
    holder = {group.target: group.hand.robot or group.eye.robot for group in reversed(problem.groups)}
    for robot in problem.robots:
        few, own = some_views(problem.with_groups(g for g in problem.groups if g.robot_end(robot)), state, _MOST_VIEWS)
        base = next((end.base for end in few.robot_ends(robot)), None)  # None of the reference
        yield Neighbourhood(
            robot,
            replace(few, columns=_columns(few, base)),
            own,
            frozenset(name for name, on in carrier.items() if on == robot),
            frozenset(name for name, on in holder.items() if on == robot),
        )


def merge_estimates(estimates: Mapping[str, NoiseEstimate], parts: Mapping[str, Neighbourhood]) -> NoiseEstimate:
    """The sigmas of all, of each from where it is reported.

    A robot's is the root of the mean of its square over all values that it may have. With few views, the likeliest
    value would make the answer look too certain.
    """
    variances = {robot: of.robot_variances[robot] for robot, of in estimates.items() if robot in of.robot_variances}
    cameras: dict[str, Noise] = {}
    shapes: dict[str, tuple[Array, Array]] = {}
    for robot, of in parts.items():
        cameras |= {name: noise for name, noise in estimates[robot].cameras.items() if name in of.cameras}
        shapes |= {name: shape for name, shape in estimates[robot].shapes.items() if name in of.targets}
    return NoiseEstimate(
        next(iter(cameras.values()), Noise()),
        1.0,
        tuple(f for f in Noise._fields if any(f in of.estimated for of in estimates.values())),
        all(of.settled for of in estimates.values()),
        {robot: np.sqrt(of) for robot, of in variances.items()},
        cameras,
        minus_2_log_evidence=sum(of.minus_2_log_evidence for of in estimates.values()),
        plain_minus_2_log_evidence=sum(of.plain_minus_2_log_evidence for of in estimates.values()),
        shapes=shapes,
        robot_variances=variances,
    )


def _columns(problem: Problem, held_base: str | None) -> dict[str, slice]:
    """The columns of what the problem's views depend on, without those of one base."""
    named: set[str | None] = set()
    for group in problem.groups:
        named |= {*group.frames, group.camera}
    named.discard(held_base)
    return sequential_columns({name: problem.column_width(name) for name in problem.columns if name in named})
