"""Sources of uncertainty of a problem's answer: noise and prior knowledge, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

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
        yield Source(f"views of {camera}", partial(_scale_views, camera))
    for robot in sorted(set(problem.stops.robot)):
        yield Source(stops_source(robot), partial(_scale_stops, robot))
    for name in problem.columns:
        if name in problem.unknowns and problem.unknowns[name].status == "prior":
            yield Source(f"prior of {name}", partial(_scale_prior, name))
        elif name in problem.lenses and problem.lenses[name].status == "prior":
            yield Source(f"lens of {name}", partial(_scale_lens, name))
    for robot, model in problem.models.items():
        if any(sigma is not None for sigma in model.sigmas.values()):
            yield Source(f"kinematics of {robot}", partial(_scale_kinematics, robot))


def stops_source(robot: str) -> str:
    """The name of the source that the stops of a robot are."""
    return f"repeatability of {robot}"


def _scale_views(camera: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    groups = (
        replace(g, measurement=g.measurement.noisier(factor)) if g.camera == camera else g for g in problem.groups
    )
    return problem.with_groups(groups), state


def _scale_stops(robot: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    mine = np.array([name == robot for name in problem.stops.robot])
    factors = np.where(mine, factor, 1.0)[:, None]
    stops = replace(problem.stops, sigma=problem.stops.sigma * factors)
    return replace(problem, stops=stops), replace(state, stop_errors=state.stop_errors / factors)


def _scale_prior(name: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    known = problem.unknowns[name]
    assert known.sigma is not None
    wider = replace(known, sigma=known.sigma * factor)
    return replace(problem, unknowns={**problem.unknowns, name: wider}), state


def _scale_lens(name: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    known = problem.lenses[name]
    assert known.sigma is not None
    wider = replace(known, sigma=known.sigma * factor)
    return replace(problem, lenses={**problem.lenses, name: wider}), state


def _scale_kinematics(robot: str, problem: Problem, state: State, factor: float) -> tuple[Problem, State]:
    model = problem.models[robot]
    columns = {
        kind: of if of.sigma is None else of._replace(sigma=of.sigma * factor) for kind, of in model.columns.items()
    }
    return replace(problem, models={**problem.models, robot: replace(model, columns=columns)}), state
