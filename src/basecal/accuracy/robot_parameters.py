"""What a solution says of the robots' own kinematics, and which of it the data have seen.

An offset is seen where the data say at least as much of it as its prior does: by the Schur complement, the information
of the data alone is 1 / v - 1 / s^2, with v its variance and s the prior's sigma, so that v < s^2 / 2.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.cell import Calibration, Cell, Compliances, JointOffsets, LinkParameters, Robot
from basecal.errors import InputError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.robot_parameters import (
    DEFLECTION,
    LINKS,
    OFFSETS,
    Kinematics,
    RobotModel,
    downwards,
    nominal,
)
from basecal.estimation.solve import Solution
from basecal.geometry import Array, BoolArray, IntArray
from basecal.numerics.spectral import spectrum

_LARGEST_SIGMA = 0.3  # [rad] of a free offset that still counts as seen
_LARGEST_COMPLIANCE_SIGMA = 3e-3  # [rad/Nm] likewise
_NO_INFORMATION = 1e-9  # eigenvalue over the largest of the information scaled to a unit diagonal: rounding is 1e-13
_TOUCHES = 1e-3  # component of a null vector, above which a column has a part in it


def joint_offsets(solution: Solution) -> dict[str, JointOffsets]:
    """The joint offsets of every robot that has some to estimate, by robot."""
    models = solution.problem.models.values()
    return {model.robot: _offsets(solution, model) for model in models if len(model.joints)}


def link_parameters(solution: Solution) -> dict[str, LinkParameters]:
    """The link parameters of every robot that has some to estimate and seen, by robot."""
    out = {}
    for model in solution.problem.models.values():
        where = solution.problem.columns.get(f"{model.robot}_{LINKS}")
        if where is None or np.any(_touched_by_null_space(solution)[where]):
            continue
        covariance = model.link_basis @ solution.covariance[where, where] @ model.link_basis.T
        links = solution.state.kinematics(model).links
        out[model.robot] = LinkParameters(links, np.sqrt(np.diag(covariance)).reshape(links.shape))
    return out


def deflection(solution: Solution) -> dict[str, Compliances]:
    """The compliances of every robot that has some to estimate, by robot."""
    out = {}
    for model in solution.problem.models.values():
        if len(model.elastic):
            compliance = solution.state.kinematics(model).compliance
            name = f"{model.robot}_{DEFLECTION}"
            limit = model.compliance_sigma, _LARGEST_COMPLIANCE_SIGMA
            of = _by_joint(solution, name, model.elastic, compliance, *limit)
            out[model.robot] = Compliances(model.chain.joint_names, of.values, np.sqrt(np.diag(of.covariance)), of.seen)
    return out


def kinematics_of(cell: Cell, calibration: Calibration) -> dict[str, Kinematics]:
    """The kinematics that a calibration gives the robots, by robot; what is not known stands at zero."""
    found = {*calibration.joint_offsets, *calibration.link_parameters, *calibration.deflection}
    return {robot: _kinematics(cell.robots[robot], calibration) for robot in sorted(found & cell.robots.keys())}


def _kinematics(robot: Robot, calibration: Calibration) -> Kinematics:
    if robot.chain is None:
        raise InputError(f"the calibration holds joint offsets of {robot.name!r}, which has no urdf in the cell")
    as_stated, name = nominal(robot.chain), robot.name
    offsets, links = calibration.joint_offsets.get(name), calibration.link_parameters.get(name)
    bent = calibration.deflection.get(name)
    return replace(
        as_stated,
        offsets=as_stated.offsets if offsets is None else np.nan_to_num(offsets.rad),
        links=as_stated.links if links is None else links.tangents,
        compliance=as_stated.compliance if bent is None else np.nan_to_num(bent.rad_per_nm),
        down=None if bent is None else downwards(robot.deflection),
    )


def _offsets(solution: Solution, model: RobotModel) -> JointOffsets:
    offsets, name = solution.state.kinematics(model).offsets, f"{model.robot}_{OFFSETS}"
    found = _by_joint(solution, name, model.joints, offsets, model.offset_sigma, _LARGEST_SIGMA)
    return JointOffsets(model.chain.joint_names, *found)


class _ByJoint(NamedTuple):
    """An unknown of each joint: its value, (n,), covariance, (n, n), and whether the data say as much as the prior."""

    values: Array
    covariance: Array
    seen: BoolArray


def _by_joint(
    solution: Solution, name: str, columns: IntArray, at: Array, prior: float | None, largest: float
) -> _ByJoint:
    """Values of an unknown of each joint, their covariance, and which are seen; NaN where nothing is known.

    Args:
        solution: Where.
        name: Of the unknown's columns.
        columns: (m,) the joints that have one.
        at: (n,) the values.
        prior: Sigma of the prior; None where free.
        largest: Sigma of a free one that still counts as seen.
    """
    n, where = len(at), solution.problem.columns[name]
    values, covariance, seen = np.full(n, np.nan), np.full((n, n), np.nan), np.zeros(n, dtype=bool)
    known = ~_touched_by_null_space(solution)[where]
    joints = columns[known]
    values[joints] = at[joints]
    covariance[np.ix_(joints, joints)] = solution.covariance[where, where][np.ix_(known, known)]
    variance = np.diag(solution.observability.inverse)[where][known]
    seen[joints] = variance < (largest**2 if prior is None else prior**2 / 2)
    if prior is None:
        values[~seen] = covariance[~seen] = covariance[:, ~seen] = np.nan
    return _ByJoint(values, covariance, seen)


def _touched_by_null_space(solution: Solution) -> BoolArray:
    """Which columns have a part in a direction without any information, (p,)."""
    if not solution.observability.unobservable:
        return np.zeros(solution.problem.width, dtype=bool)
    hessian = linearise(solution.problem, solution.state).hessian
    of = spectrum(hessian, _NO_INFORMATION)
    return np.asarray(np.abs(of.vectors[:, ~of.held]).max(axis=-1, initial=0.0) > _TOUCHES)
