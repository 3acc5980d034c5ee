"""Uncertainty of transforms by free parameters of robots that a gauge holds at zero.

A first joint turns an arm as its base does: if both are free, the joint is held. Its true value is of the size of those
that were found, or of those that arms usually have. Source: docs/mathematics.md (9.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from basecal.accuracy.systematic_errors.score_tests import sums
from basecal.accuracy.systematic_errors.situation import situate
from basecal.cell import HeldGauge
from basecal.effects.faces.candidates import Views, one_candidate, robot_moves
from basecal.effects.faces.robot_parameter import Columns, Posture
from basecal.effects.faces.shared_errors import KINEMATICS
from basecal.effects.registry import RANDOM_EFFECTS, ROBOT_PARAMETERS
from basecal.estimation.problem.robot_parameters import RobotModel, column_derivative
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

_LEVER_M = KINEMATICS.lever[0] or 0.0
_NODES = np.arange(-3.0, 3.5, 0.5)  # of the logarithm of a sigma, in standard deviations


class _Kind(NamedTuple):
    """Free parameters of one kind, w numbers in units in which they count equally.

    Attributes:
        name: Of the kind.
        units: (w,) of each.
        found: (w, r) directions that the data determine.
        held: (w, h) those that a gauge holds.
        sigmas: (w,) expected, in those units, for a turn of one radian.
    """

    name: str
    units: Array
    found: Array
    held: Array
    sigmas: Array


def held_gauges(solution: Solution, order: Sequence[str]) -> tuple[HeldGauge, ...]:
    """Uncertainty of transforms of these names by each robot's parameters that a gauge holds."""
    free = {robot: list(_free_kinds(model)) for robot, model in solution.problem.models.items()}
    gauges, square = [], _expected_square(solution, free)
    for robot, kinds in free.items():
        columns = {kind.name: Columns(kind.units[:, None] * kind.held, None) for kind in kinds if kind.held.shape[1]}
        if columns:
            moved = _moved_columns(solution, replace(solution.problem.models[robot], columns=columns))
            held = block_diag(*(_squares(kind.sigmas, kind.held) for kind in kinds if kind.held.shape[1]))
            wide = replace(solution, covariance=square * moved @ held @ moved.T)
            gauges.append(HeldGauge(robot, tuple(columns), wide.joint_transform_covariance(list(order))))
    return tuple(gauges)


def _free_kinds(model: RobotModel) -> Iterator[_Kind]:
    """Kinds of parameters of a robot that are free, and of which sizes are expected."""
    joints = np.zeros((1, model.chain.n))
    posture = Posture(model.chain, joints, model.chain.posture(joints))
    for name, (basis, sigma) in model.columns.items():
        effect = RANDOM_EFFECTS.get(name)
        shared = None if effect is None or effect.by_joints is None else effect.by_joints(posture)
        if sigma is None and effect is not None and effect.is_mapped and shared is not None:
            units = np.diag(ROBOT_PARAMETERS[name].columns(model.chain, model.stated[name]).basis)
            found = basis / units[:, None]
            rest = spectrum(np.eye(len(units)) - found @ found.T)
            held = rest.vectors[:, rest.held]
            yield _Kind(name, units, found, held, np.where(shared.is_turn, 1.0, _LEVER_M) / units)


def _moved_columns(solution: Solution, gauge: RobotModel) -> Array:
    """How the answer moves with held parameters, (p, h)."""
    situation = situate(solution)
    kinematics = solution.state.kinematics(gauge)

    def moves(views: Views, k: int, robot: str) -> Array:
        """Moves of the views of a group, (n, 6, h)."""
        end = solution.problem.groups[k].robot_end(robot)
        assert end is not None
        assert end.joints is not None
        return views.flange_jacobian(k, robot) @ column_derivative(gauge, kinematics, end.joints)

    known = sums(
        situation.linearisation, one_candidate("", gauge.robot, "", robot_moves(situation, gauge.robot, moves))
    )
    return np.asarray(-situation.linearisation.inverse @ known.across[0].T)


def _expected_square(solution: Solution, free: Mapping[str, Sequence[_Kind]]) -> float:
    """Mean of the square of a turn [rad^2], over sigmas that count by the evidence of what was found of all arms."""
    middle, factor = KINEMATICS.turn
    squares, evidence = (middle * factor**_NODES) ** 2, -(_NODES**2)
    for robot, kinds in free.items():
        for kind in kinds:
            at = solution.problem.columns.get(f"{robot}_{kind.name}", slice(0, 0))
            values = solution.state.kinematics(solution.problem.models[robot]).kind_values(kind.name).ravel()
            found = kind.found.T @ (values / kind.units)
            spreads = squares[:, None, None] * _squares(kind.sigmas, kind.found) + solution.covariance[at, at]
            likely = np.linalg.solve(spreads, np.broadcast_to(found[:, None], (len(squares), len(found), 1)))
            evidence = evidence - np.linalg.slogdet(spreads)[1] - likely[..., 0] @ found
    shares = np.exp(0.5 * (evidence - evidence.max()))
    return float(shares @ squares / shares.sum())


def _squares(sigmas: Array, directions: Array) -> Array:
    """Second moments along directions, (k, k), of independent numbers."""
    scaled = sigmas[:, None] * directions
    return scaled.T @ scaled
