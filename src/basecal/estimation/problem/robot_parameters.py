"""Estimated parameters of a robot's kinematics, of any kind.

The forward kinematics apply the parameters to the chain and to the recorded joints. Parameters of the first and last
link cannot be separated from a free base and from free mounts on the flange. In this case the parameters of the arm
are held at zero, which defines the base and the mounts.
Source: docs/mathematics.md (9.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from basecal.cell import Parameters
from basecal.effects.faces.robot_parameter import Columns, Posture
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.errors import InputError
from basecal.estimation.problem.gauges import determined_directions, determined_joints, end_moves
from basecal.geometry import SE3, Array
from basecal.kinematics import SerialChain
from basecal.numerics.batch import SHARED


@dataclass(frozen=True, eq=False)
class RobotModel:
    """Columns of one robot's kinematic parameters.

    Attributes:
        robot: Name of the robot.
        chain: Stated kinematics, with n joints.
        stated: Stated parameters that are not fixed, by kind.
        columns: Estimated columns, by kind; those of a per-joint kind may be empty.
    """

    robot: str
    chain: SerialChain
    stated: Mapping[str, Parameters]
    columns: Mapping[str, Columns]

    @property
    def names(self) -> dict[str, str]:
        """Map from the name of the columns to the kind of parameter."""
        return {f"{self.robot}_{kind}": kind for kind in self.columns}

    @property
    def widths(self) -> dict[str, int]:
        """Number of columns of each kind, by name."""
        return {name: self.columns[kind].basis.shape[1] for name, kind in self.names.items()}

    @property
    def sigmas(self) -> dict[str, Array | None]:
        """Prior sigmas of the columns of each kind, by name; None if the columns are free."""
        return {name: self.columns[kind].sigma for name, kind in self.names.items()}

    def select_joint(self, kind: str, joint: int) -> RobotModel:
        """Return a copy in which a per-joint kind keeps only the columns of one joint."""
        basis, sigma = self.columns[kind]
        own_columns = np.flatnonzero(basis[joint])
        return replace(
            self,
            columns={
                **self.columns,
                kind: Columns(basis[:, own_columns], None if sigma is None else sigma[own_columns]),
            },
        )


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Kinematics of a robot with parameter values, or a batch of values.

    Attributes:
        chain: Stated kinematics.
        values: Values of the parameters by kind, with a leading batch axis for a batch; missing kinds are zero.
        stated: Stated parameters, by kind.
    """

    chain: SerialChain = field(metadata=SHARED)
    values: Mapping[str, Array] = field(default_factory=dict)
    stated: Mapping[str, Parameters] = field(default_factory=dict, metadata=SHARED)

    @cached_property
    def moved_chain(self) -> SerialChain:
        """The chain changed by the parameters, without their shifts of the joints."""
        chain = self.chain
        for kind, values in self.values.items():
            chain = ROBOT_PARAMETERS[kind].move_chain(chain, values)
        return chain

    def repeat(self, model: RobotModel | None, count: int) -> Kinematics:
        """Repeat a single entry `count` times as a batch, with values of all kinds that a model estimates."""
        values = {**self.values, **({} if model is None else {kind: self.kind_values(kind) for kind in model.columns})}
        return replace(
            self, values={kind: np.broadcast_to(value, (count, *value.shape)) for kind, value in values.items()}
        )

    def kind_values(self, kind: str) -> Array:
        """Values of a kind of parameter; zeros if there are none."""
        return self.values[kind] if kind in self.values else ROBOT_PARAMETERS[kind].zero(self.chain.n)

    def stated_parameters(self, kind: str) -> Parameters:
        """Stated parameters of a kind; the default of the kind if there are none."""
        return self.stated[kind] if kind in self.stated else ROBOT_PARAMETERS[kind].stated()

    def forward(self, joints: Array) -> SE3:
        """Forward kinematics `base_from_flange`, ([b,] m), at recorded joints ([b,] m, n) [rad]."""
        return self.moved_chain.forward(self.true_joints(joints))

    def true_joints(self, joints: Array) -> Array:
        """True joints at recorded joints, ([b,] m, n) each [rad]; the shifts of all kinds add up."""
        true = joints
        for kind, values in self.values.items():
            true = true + ROBOT_PARAMETERS[kind].shift(self.chain, self.stated_parameters(kind), joints, values)
        return true


def robot_model(
    robot: str,
    chain: SerialChain,
    parameters: Mapping[str, Parameters],
    joints: Array,
    free_ends: tuple[bool, bool] = (False, False),
) -> RobotModel:
    """Choose the columns of the parameters that are not fixed.

    Free parameters keep the columns that the recorded joints separate from all other unknowns.

    Args:
        robot: Name of the robot.
        chain: Stated kinematics.
        parameters: Stated parameters, by kind.
        joints: (m, n) recorded joints [rad].
        free_ends: Whether the base is free, and whether everything on the flange is free.

    Raises:
        InputError: if the robot lacks what a kind needs.
    """
    requested = {
        kind: parameters[kind] for kind in ROBOT_PARAMETERS if kind in parameters and parameters[kind].status != "fixed"
    }
    posture = Posture(chain, joints, chain.posture(joints))
    others = end_moves(posture.true.base_from_flange, free_ends)
    columns = {}
    for name, stated in requested.items():
        kind = ROBOT_PARAMETERS[name]
        try:
            kind_columns = kind.columns(chain, stated)
        except InputError as error:
            raise InputError(f"robot {robot!r}: {name} {error}") from None
        derivative = kind.derivative(posture, stated, kind.zero(chain.n))
        if kind_columns.sigma is None:
            moves = kind.scale * derivative @ kind_columns.basis
            basis = (
                kind_columns.basis[:, determined_joints(moves, others)]
                if kind.is_by_joint
                else kind_columns.basis @ determined_directions(moves, others)
            )
            kind_columns = Columns(basis, None)
        columns[name] = kind_columns
        others = np.concatenate([others, kind.scale * derivative @ kind_columns.basis], axis=-1)
    # Per-joint kinds are kept even if no joint has a column.
    columns_in_use = {
        name: kind_columns
        for name, kind_columns in columns.items()
        if kind_columns.basis.shape[1] or ROBOT_PARAMETERS[name].is_by_joint
    }
    return RobotModel(robot, chain, requested, columns_in_use)


def column_derivative(model: RobotModel, kinematics: Kinematics, joints: Array) -> Array:
    """Derivative of `base_from_flange` with respect to all columns, (..., m, 6, k), right tangents.

    Args:
        model: The columns.
        kinematics: Parameter values at which to linearise.
        joints: (..., m, n) recorded joints [rad].
    """
    posture = Posture(model.chain, joints, kinematics.moved_chain.posture(kinematics.true_joints(joints)))
    parts = [posture.true.joint_derivative[..., :0]]
    for kind, columns in model.columns.items():
        derivative = ROBOT_PARAMETERS[kind].derivative(posture, model.stated[kind], kinematics.kind_values(kind))
        parts.append(derivative @ columns.basis)
    return np.concatenate(parts, -1)


def apply_step(model: RobotModel, kinematics: Kinematics, step: Mapping[str, Array]) -> Kinematics:
    """Return the kinematics after a step, given as (..., k) by name of the columns."""
    values = dict(kinematics.values)
    for name, kind in model.names.items():
        previous = kinematics.kind_values(kind)
        change = step[name] @ model.columns[kind].basis.T
        values[kind] = previous + change.reshape(*change.shape[:-1], *ROBOT_PARAMETERS[kind].zero(model.chain.n).shape)
    return replace(kinematics, values=values)


def column_values(model: RobotModel, kinematics: Kinematics) -> dict[str, Array]:
    """Values of the columns with a prior, (..., k), by name."""
    by_name = {}
    for name, kind in model.names.items():
        basis, sigma = model.columns[kind]
        if sigma is not None:
            values, zero = kinematics.kind_values(kind), ROBOT_PARAMETERS[kind].zero(model.chain.n)
            by_name[name] = values.reshape(*values.shape[: values.ndim - zero.ndim], -1) @ basis
    return by_name
