"""The null model of score tests: a solved problem with the random effects that stops share, by their likeliest kind.

Its sigmas are those of single stops and views, estimated beside these effects. Sigmas that were estimated without them
absorb what stops share, and the motion by any effect under test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from basecal.accuracy.systematic_errors.score_tests import Linearised, linearise_views, with_random_effects
from basecal.effects.faces.candidates import Moves
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.random_effects import held_errors
from basecal.estimation.problem.problem import Problem, State
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum

# Of the information about a random effect in its sigmas: less hardly changes what is known of it;
# `benchmarks.false_alarms` judges it.
_LEAST_SEEN = 1e-2


def null_model(
    problem: Problem, state: State, noise: NoiseEstimate, flange_jacobian: Callable[[int, str], Array]
) -> Linearised:
    """A problem about a state with the random effects of the noise, which has some.

    Args:
        problem: The problem, with the sigmas of `noise`.
        state: Its optimum.
        noise: The noise in use.
        flange_jacobian: How views of a group move with a right tangent of a robot's flange, (n, 6, 6).
    """
    assert noise.beside_common is not None
    beside = noise.beside_common.hold_sigmas(problem)
    # Errors of stops stay the same in metres and radians.
    errors = state.stop_errors * problem.stops.sigma / beside.stops.sigma
    model = linearise_views(beside, replace(state, stop_errors=errors))
    return with_random_effects(model, _independent_moves(model, _effect_moves(problem, noise.common, flange_jacobian)))


def _effect_moves(
    problem: Problem, common: Mapping[str, Mapping[str, Array]], flange_jacobian: Callable[[int, str], Array]
) -> Moves:
    """How views of each group move with one sigma of each error that stops share, (n, 6, r)."""
    units, moves = held_errors(problem, common), []
    for k, group in enumerate(problem.groups):
        parts = []
        for robot, unit in units.items():
            end = group.robot_end(robot)
            still = np.zeros((len(group), 6, unit.shape[-1]))
            parts.append(still if end is None else flange_jacobian(k, robot) @ unit[end.stand])
        moves.append(np.concatenate(parts, axis=-1) if parts else None)
    return tuple(moves)


def _independent_moves(model: Linearised, moves: Moves) -> Moves:
    """Random effects turned into independent ones that the views show, as few as there are."""
    pairs = [(views.information[:, :6, :6], m) for views, m in zip(model.views, moves, strict=True) if m is not None]
    if not pairs:
        return moves
    information = sum(np.tensordot(m, h @ m, ((0, 1), (0, 1))) for h, m in pairs)
    of = scaled_spectrum(np.asarray(information), _LEAST_SEEN)
    return tuple(None if m is None else m @ of.vectors[:, of.held] for m in moves)
