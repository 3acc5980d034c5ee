"""Estimates of the robots' kinematic parameters, and which of them are observable.

A parameter is observable if the data have at least as much information about it as the prior. By the Schur complement,
the information of the data alone is 1 / v - 1 / s^2, with the variance v and the prior's sigma s. So the condition is
v < s^2 / 2.
"""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration, Cell, RobotParameters
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.errors import InputError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.observability.observability import TOUCHED_SHARE
from basecal.estimation.problem.robot_parameters import Kinematics, RobotModel
from basecal.estimation.solve import Solution
from basecal.geometry import BoolArray
from basecal.numerics.spectral import spectrum


def robot_parameters(solution: Solution) -> dict[str, dict[str, RobotParameters]]:
    """Estimated parameters of the robots, by kind, then by robot.

    A kind without a value per joint is omitted if the data do not determine all of its values.
    """
    hidden = _touched_by_null_space(solution)
    found: dict[str, dict[str, RobotParameters]] = {}
    for kind, definition in ROBOT_PARAMETERS.items():
        for model in solution.problem.models.values():
            if kind not in model.columns:
                continue
            if definition.is_by_joint:
                estimate = _parameters_by_joint(solution, model, kind, hidden)
            elif not np.any(hidden[solution.problem.columns[f"{model.robot}_{kind}"]]):
                estimate = _jointly_observable(solution, model, kind)
            else:
                continue
            found.setdefault(kind, {})[model.robot] = estimate
    return found


def calibrated_kinematics(cell: Cell, calibration: Calibration) -> dict[str, Kinematics]:
    """Calibrated kinematics by robot; unknown parameters are zero.

    Raises:
        InputError: if the calibration has parameters of a robot without a kinematic chain.
    """
    kinematics = {}
    for name, robot in cell.robots.items():
        found = calibration.parameters_of_robot(name)
        if found and robot.chain is None:
            raise InputError(f"the calibration holds kinematic parameters of {name!r}, which has no urdf in the cell")
        if found and robot.chain is not None:
            values = {kind: np.nan_to_num(of.values) for kind, of in found.items()}
            kinematics[name] = Kinematics(robot.chain, values, robot.parameters)
    return kinematics


def _jointly_observable(solution: Solution, model: RobotModel, kind: str) -> RobotParameters:
    """Values of a kind whose parameters are only observable jointly, with their sigmas."""
    where, basis = solution.problem.columns[f"{model.robot}_{kind}"], model.columns[kind].basis
    values = solution.state.kinematics(model).kind_values(kind)
    covariance = basis @ solution.covariance[where, where] @ basis.T
    sigma = np.sqrt(np.diag(covariance)).reshape(values.shape)
    return RobotParameters((), values, sigma, np.ones(values.shape, dtype=bool))


def _parameters_by_joint(
    solution: Solution, model: RobotModel, kind: str, is_unobservable: BoolArray
) -> RobotParameters:
    """Values of the joints, their covariance, and which are observable; NaN for undetermined values."""
    n, where = model.chain.n, solution.problem.columns[f"{model.robot}_{kind}"]
    basis, prior = model.columns[kind]
    values, covariance, seen = np.full(n, np.nan), np.full((n, n), np.nan), np.zeros(n, dtype=bool)
    known = ~is_unobservable[where]
    joints = basis.argmax(axis=0)[known]
    values[joints] = solution.state.kinematics(model).kind_values(kind)[joints]
    covariance[np.ix_(joints, joints)] = solution.covariance[where, where][np.ix_(known, known)]
    variance = np.diag(solution.observability.inverse)[where][known]
    largest = ROBOT_PARAMETERS[kind].largest_sigma
    seen[joints] = variance < (largest**2 if prior is None else prior[known] ** 2 / 2)
    if prior is None:
        values[~seen] = covariance[~seen] = covariance[:, ~seen] = np.nan
    return RobotParameters(model.chain.joint_names, values, np.sqrt(np.diag(covariance)), seen, covariance)


def _touched_by_null_space(solution: Solution) -> BoolArray:
    """Whether each column takes part in a direction without information, (p,)."""
    if not solution.observability.unobservable:
        return np.zeros(solution.problem.width, dtype=bool)
    hessian = linearise(solution.problem, solution.state).hessian
    spectral = spectrum(hessian)
    return np.asarray(np.abs(spectral.vectors[:, ~spectral.is_informative]).max(axis=1, initial=0.0) > TOUCHED_SHARE)
