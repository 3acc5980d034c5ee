"""Estimated parameters of a robot's own kinematics, of any kind.

The pose of a robot given by joints is that of its chain, with the parameters applied to the chain and to the recorded
joints. Ends of an arm cannot be distinguished from what they are attached to. If both sides of such a pair are free,
the arm's side is held at zero, which defines the other.
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
    """The columns of one robot's kinematics.

    Attributes:
        robot: Its name.
        chain: Its kinematics as stated, of n joints.
        stated: What is known of its parameters, by kind; of those that are not fixed.
        columns: What of them is estimated, by kind; of those given joint by joint it may be none.
    """

    robot: str
    chain: SerialChain
    stated: Mapping[str, Parameters]
    columns: Mapping[str, Columns]

    @property
    def names(self) -> dict[str, str]:
        """Kinds by the names of their columns."""
        return {f"{self.robot}_{kind}": kind for kind in self.columns}

    @property
    def widths(self) -> dict[str, int]:
        """How many columns there are of each kind that has any, by name."""
        return {name: self.columns[kind].basis.shape[1] for name, kind in self.names.items()}

    @property
    def sigmas(self) -> dict[str, Array | None]:
        """Sigmas of the prior of each kind's columns, by name; None if they are free."""
        return {name: self.columns[kind].sigma for name, kind in self.names.items()}

    def select_joint(self, kind: str, joint: int) -> RobotModel:
        """A copy with the columns of one joint alone of a kind that has a number for each."""
        basis, sigma = self.columns[kind]
        own = np.flatnonzero(basis[joint])
        return replace(
            self, columns={**self.columns, kind: Columns(basis[:, own], None if sigma is None else sigma[own])}
        )


@dataclass(frozen=True, eq=False)
class Kinematics:
    """A value of a robot's kinematics, or a batch of them.

    Attributes:
        chain: As stated.
        values: Of its parameters, by kind, with the batch's axis first; those of kinds that are not there are zero.
        stated: What is known of them, by kind.
    """

    chain: SerialChain = field(metadata=SHARED)
    values: Mapping[str, Array] = field(default_factory=dict)
    stated: Mapping[str, Parameters] = field(default_factory=dict, metadata=SHARED)

    @cached_property
    def moved_chain(self) -> SerialChain:
        """The chain moved by the parameters; shifts of joints are not in it."""
        chain = self.chain
        for kind, values in self.values.items():
            chain = ROBOT_PARAMETERS[kind].moved(chain, values)
        return chain

    def spread(self, model: RobotModel | None, count: int) -> Kinematics:
        """A single one so many times, with values of all kinds that a model estimates."""
        kinds = {**self.values, **({} if model is None else {kind: self.kind_values(kind) for kind in model.columns})}
        return replace(self, values={kind: np.broadcast_to(of, (count, *of.shape)) for kind, of in kinds.items()})

    def kind_values(self, kind: str) -> Array:
        """The values of a kind."""
        return self.values[kind] if kind in self.values else ROBOT_PARAMETERS[kind].zero(self.chain.n)

    def stated_parameters(self, kind: str) -> Parameters:
        """Stated knowledge of a kind."""
        return self.stated[kind] if kind in self.stated else ROBOT_PARAMETERS[kind].stated()

    def forward(self, joints: Array) -> SE3:
        """`base_from_flange`, ([b,] m), at recorded joints ([b,] m, n) [rad]."""
        return self.moved_chain.forward(self.true_joints(joints))

    def true_joints(self, joints: Array) -> Array:
        """Where recorded joints ([b,] m, n) truly stand [rad]; each kind shifts them as recorded."""
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
    """The columns of what is not fixed; of what is free, those that the recorded joints separate from all else.

    Args:
        robot: Its name.
        chain: Its kinematics as stated.
        parameters: What is known of its parameters, by kind.
        joints: (m, n) as recorded [rad].
        free_ends: Whether its base, and whether all that its flange carries, are free.

    Raises:
        InputError: if the robot lacks what a kind needs.
    """
    asked = {
        kind: parameters[kind] for kind in ROBOT_PARAMETERS if kind in parameters and parameters[kind].status != "fixed"
    }
    at = Posture(chain, joints, chain.posture(joints))
    others = end_moves(at.true.base_from_flange, free_ends)
    columns = {}
    for name, known in asked.items():
        kind = ROBOT_PARAMETERS[name]
        try:
            of = kind.columns(chain, known)
        except InputError as error:
            raise InputError(f"robot {robot!r}: {name} {error}") from None
        derivative = kind.derivative(at, known, kind.zero(chain.n))
        if of.sigma is None:
            moves = kind.scale * derivative @ of.basis
            told = (
                of.basis[:, determined_joints(moves, others)]
                if kind.is_by_joint
                else of.basis @ determined_directions(moves, others)
            )
            of = Columns(told, None)
        columns[name] = of
        others = np.concatenate([others, kind.scale * derivative @ of.basis], axis=-1)
    # What is told joint by joint is told of none, too.
    kept = {name: of for name, of in columns.items() if of.basis.shape[1] or ROBOT_PARAMETERS[name].is_by_joint}
    return RobotModel(robot, chain, asked, kept)


def column_derivative(model: RobotModel, kinematics: Kinematics, joints: Array) -> Array:
    """Derivative of `base_from_flange` to all columns, (..., m, 6, k), right tangents.

    Args:
        model: The columns.
        kinematics: Where.
        joints: (..., m, n) as recorded [rad].
    """
    at = Posture(model.chain, joints, kinematics.moved_chain.posture(kinematics.true_joints(joints)))
    parts = [at.true.joint_derivative[..., :0]]
    for kind, columns in model.columns.items():
        derivative = ROBOT_PARAMETERS[kind].derivative(at, model.stated[kind], kinematics.kind_values(kind))
        parts.append(derivative @ columns.basis)
    return np.concatenate(parts, -1)


def apply_step(model: RobotModel, kinematics: Kinematics, step: Mapping[str, Array]) -> Kinematics:
    """The kinematics after steps of the columns, (..., k), by their names."""
    values = dict(kinematics.values)
    for name, kind in model.names.items():
        before = kinematics.kind_values(kind)
        moved = step[name] @ model.columns[kind].basis.T
        values[kind] = before + moved.reshape(*moved.shape[:-1], *ROBOT_PARAMETERS[kind].zero(model.chain.n).shape)
    return replace(kinematics, values=values)


def column_values(model: RobotModel, kinematics: Kinematics) -> dict[str, Array]:
    """Values of the columns with a prior, (..., k), by name; each is of one value."""
    found = {}
    for name, kind in model.names.items():
        basis, sigma = model.columns[kind]
        if sigma is not None:
            values, zero = kinematics.kind_values(kind), ROBOT_PARAMETERS[kind].zero(model.chain.n)
            found[name] = values.reshape(*values.shape[: values.ndim - zero.ndim], -1) @ basis
    return found
