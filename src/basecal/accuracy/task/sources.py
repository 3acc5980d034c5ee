"""Sources of uncertainty of a problem's answer: noise and prior knowledge, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from basecal.estimation.problem.problem import Problem, State


@dataclass(frozen=True)
class Source:
    """A source of error.

    Attributes:
        name: In words, with the name of what it is of.
        scaled: The problem and a state with its sigma so many times as large; errors stay what they are in metres.
    """

    name: str
    scaled: Callable[[Problem, State, float], tuple[Problem, State]]


def error_sources(problem: Problem) -> Iterator[Source]:
    """All sources of a problem whose sigmas are stated or estimated: views, robots' stops, priors."""
    for camera in sorted({group.camera for group in problem.groups}):
        yield Source(f"views of {camera}", _views(camera))
    for robot in sorted(set(problem.stops.robot)):
        yield Source(stops_source(robot), _stops(robot))
    for name in problem.columns:
        if name in problem.unknowns and problem.unknowns[name].status == "prior":
            yield Source(f"prior of {name}", _transform(name))
        elif name in problem.lenses and problem.lenses[name].status == "prior":
            yield Source(f"lens of {name}", _lens(name))
    for robot, model in problem.models.items():
        if any(sigma is not None for sigma in model.sigmas.values()):
            yield Source(f"kinematics of {robot}", _kinematics(robot))


def stops_source(robot: str) -> str:
    """The name of the source that the stops of a robot are."""
    return f"repeatability of {robot}"


def _views(camera: str) -> Callable[[Problem, State, float], tuple[Problem, State]]:
    def scale(problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
        """See `Source`."""
        groups = (
            replace(g, measurement=g.measurement.noisier(factor)) if g.camera == camera else g for g in problem.groups
        )
        return problem.with_groups(groups), state

    return scale


def _stops(robot: str) -> Callable[[Problem, State, float], tuple[Problem, State]]:
    def scale(problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
        """See `Source`."""
        mine = np.array([name == robot for name in problem.stops.robot])
        factors = np.where(mine, factor, 1.0)[:, None]
        stops = replace(problem.stops, sigma=problem.stops.sigma * factors)
        return replace(problem, stops=stops), replace(state, stop_errors=state.stop_errors / factors)

    return scale


def _transform(name: str) -> Callable[[Problem, State, float], tuple[Problem, State]]:
    def scale(problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
        """See `Source`."""
        known = problem.unknowns[name]
        assert known.sigma is not None
        wider = replace(known, sigma=known.sigma * factor)
        return replace(problem, unknowns={**problem.unknowns, name: wider}), state

    return scale


def _lens(name: str) -> Callable[[Problem, State, float], tuple[Problem, State]]:
    def scale(problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
        """See `Source`."""
        known = problem.lenses[name]
        assert known.sigma is not None
        wider = replace(known, sigma=known.sigma * factor)
        return replace(problem, lenses={**problem.lenses, name: wider}), state

    return scale


def _kinematics(robot: str) -> Callable[[Problem, State, float], tuple[Problem, State]]:
    def scale(problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
        """See `Source`."""
        model = problem.models[robot]
        columns = {
            kind: of if of.sigma is None else of._replace(sigma=of.sigma * factor) for kind, of in model.columns.items()
        }
        return replace(problem, models={**problem.models, robot: replace(model, columns=columns)}), state

    return scale
