"""Uncertainty of transforms due to free robot parameters that a gauge holds at zero.

The offset of a first joint rotates a robot as its base does: if both are free, the joint offset is held at zero. Its
true value has the size of the estimated offsets, or of those of typical robots. Source: docs/mathematics.md (9.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from basecal.accuracy.systematic_errors.score_tests import view_sums
from basecal.accuracy.systematic_errors.situation import situate
from basecal.cell import HeldGauge
from basecal.effects.faces.candidates import Views, one_candidate, robot_moves
from basecal.effects.faces.robot_parameter import Columns, Posture
from basecal.effects.faces.shared_errors import KINEMATICS
from basecal.effects.registry import RANDOM_EFFECTS, ROBOT_PARAMETERS
from basecal.estimation.problem.robot_parameters import RobotModel, column_derivative
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.spectral import INDEPENDENT_SHARE, scaled_spectrum

_LEVER_M = KINEMATICS.lever[0] or 0.0
_NODES = np.arange(-3.0, 3.5, 0.5)  # nodes of the logarithm of a sigma, in standard deviations


class _Kind(NamedTuple):
    """Free parameters of one kind, w numbers, scaled to comparable units.

    Attributes:
        name: Name of the kind.
        units: Unit of each parameter, (w,).
        determined: Directions that the data determine, (w, r).
        held: Directions that a gauge holds, (w, h).
        sigmas: Expected sigmas in these units for a sigma of rotation of one radian, (w,).
    """

    name: str
    units: Array
    determined: Array
    held: Array
    sigmas: Array


def held_gauges(solution: Solution, order: Sequence[str]) -> tuple[HeldGauge, ...]:
    """Uncertainty of the named transforms due to the parameters of each robot that a gauge holds."""
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
    """Kinds of free robot parameters whose expected size is known."""
    joints = np.zeros((1, model.chain.n))
    posture = Posture(model.chain, joints, model.chain.posture(joints))
    for name, (basis, sigma) in model.columns.items():
        effect = RANDOM_EFFECTS.get(name)
        shared = None if effect is None or effect.by_joints is None else effect.by_joints(posture)
        if sigma is None and effect is not None and effect.is_mapped and shared is not None:
            units = np.diag(ROBOT_PARAMETERS[name].columns(model.chain, model.stated[name]).basis)
            determined = basis / units[:, None]
            rest = scaled_spectrum(np.eye(len(units)) - determined @ determined.T, INDEPENDENT_SHARE)
            held = rest.vectors[:, rest.is_informative]
            yield _Kind(name, units, determined, held, np.where(shared.is_turn, 1.0, _LEVER_M) / units)


def _moved_columns(solution: Solution, gauge: RobotModel) -> Array:
    """Derivative of the answer with respect to held parameters, (p, h)."""
    situation = situate(solution)
    kinematics = solution.state.kinematics(gauge)

    def moves(views: Views, k: int, robot: str) -> Array:
        """Derivatives of the views of a group with respect to the held parameters, (n, 6, h)."""
        end = solution.problem.groups[k].robot_end(robot)
        assert end is not None
        assert end.joints is not None
        return views.flange_jacobian(k, robot) @ column_derivative(gauge, kinematics, end.joints)

    known = view_sums(
        situation.linearisation, one_candidate("", gauge.robot, "", robot_moves(situation, gauge.robot, moves))
    )
    return np.asarray(-situation.linearisation.inverse @ known.across[0].T)


def _expected_square(solution: Solution, free: Mapping[str, Sequence[_Kind]]) -> float:
    """Expected squared rotation [rad^2]: mean over sigmas, weighted by the evidence of all estimated parameters."""
    middle, factor = KINEMATICS.turn
    squares, evidence = (middle * factor**_NODES) ** 2, -(_NODES**2)
    for robot, kinds in free.items():
        for kind in kinds:
            columns = solution.problem.columns.get(f"{robot}_{kind.name}", slice(0, 0))
            values = solution.state.kinematics(solution.problem.models[robot]).kind_values(kind.name).ravel()
            sizes = kind.determined.T @ (values / kind.units)
            spreads = (
                squares[:, None, None] * _squares(kind.sigmas, kind.determined) + solution.covariance[columns, columns]
            )
            weighted = np.linalg.solve(spreads, np.broadcast_to(sizes[:, None], (len(squares), len(sizes), 1)))
            evidence = evidence - np.linalg.slogdet(spreads)[1] - weighted[..., 0] @ sizes
    shares = np.exp(0.5 * (evidence - evidence.max()))
    return float(shares @ squares / shares.sum())


def _squares(sigmas: Array, directions: Array) -> Array:
    """Second moments of independent numbers with these sigmas along directions, (k, k)."""
    scaled = sigmas[:, None] * directions
    return scaled.T @ scaled
