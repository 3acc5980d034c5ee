"""Errors that a robot's stops share: unit errors, of one sigma for shifts and one for turns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.numerics.spectral import pseudo_inverse

_ARM_M = 0.5  # what angles count as, beside lengths [m/rad]
TIE = 1.05
"""Factor of a shift to reach times turn: a looser one splits shared errors wrongly between the two."""


class SharedPrior(NamedTuple):
    """The expected two sigmas of errors that a robot's stops share.

    Attributes:
        turn: Mean of that of turns, and the factor of a standard deviation.
        source: Of the numbers, or `assumed`.
        is_over_stop: Whether these are over the sigma of single stops; else they are in radians.
        lever: Mean of a shift over a turn [m], that of the robot's reach if None, and the factor.
        tie: That factor of single stops' shifts over reach times turns, beside these errors.
    """

    turn: tuple[float, float]
    source: str
    is_over_stop: bool = True
    lever: tuple[float | None, float] = (None, TIE)
    tie: float = TIE


KINEMATICS = SharedPrior(
    (8e-4, 5.0),
    "1.2 mrad within a factor of 1.9 on fifteen arms of Universal Robots and two Motoman MA1400. 0.8 mrad for the "
    "accuracy of 0.5 to 2 mm of arms as delivered (Nubiola & Bonev 2013)",
    is_over_stop=False,
    lever=(0.2, 2.0),
)
"""Of each joint and link of an arm that is built otherwise than stated.

Factory calibrations show the errors of a type's URDF. Those of fifteen arms of Universal Robots are in public
repositories: rotations of 1.2 mrad within a factor of 1.9, equal over joints and links, and shifts of 0.1 m times that.
Two Motoman MA1400 have 1.2 mrad and 0.65 mm. An accuracy of 0.5 to 2 mm comes of 0.8 mrad (Nubiola & Bonev 2013). That
of a calibrated arm, of a tenth, and the 7 mrad of hobbyists' arms are within one and a half standard deviations.
"""


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Errors that a robot's stops share.

    Attributes:
        by_stop: (stops, 6, k) how the flange at each stop moves with each error, right tangents.
        is_turn: (k,) whether an error goes by the sigma of turns [rad]; the others go by that of shifts [m].
    """

    by_stop: Array
    is_turn: BoolArray

    def flange_sigmas(self, sigmas: Array) -> Array:
        """Sigmas at the flange, (6,), by those of a shift and of a turn, (2,): the root mean square over stops."""
        scaled = self.by_stop * sigmas[self.is_turn.astype(np.int64)]
        return np.asarray(np.sqrt(np.mean(np.sum(scaled**2, axis=-1), axis=0)))

    def remove_frames(self, poses: SE3) -> SharedErrors:
        """The part of the errors that no free base and no free mount absorbs.

        Args:
            poses: Of the flange at each stop, (stops,).
        """
        units = np.repeat([1.0, _ARM_M], 3)
        frames = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (len(poses), 6, 6))], axis=-1)
        by_frames = (units[:, None] * frames).reshape(-1, 12)
        flat = (units[:, None] * self.by_stop).reshape(len(by_frames), -1)
        left = flat - by_frames @ (pseudo_inverse(by_frames) @ flat)
        return replace(self, by_stop=left.reshape(self.by_stop.shape) / units[:, None])

    def rotate_to(self, poses: SE3, axes: Array | None = None) -> SharedErrors:
        """A copy along axes in the base, (stops, 3, 3) or its own, not those of the flange at poses, (stops,)."""
        flange_from_axes = poses.rotation.mT if axes is None else poses.rotation.mT @ axes
        return replace(self, by_stop=np.kron(np.eye(2), flange_from_axes) @ self.by_stop)

    @classmethod
    def repeat_coordinates(cls, modes: Array) -> SharedErrors:
        """Errors of each coordinate by modes, (stops, j): what a unit error of each is at each stop."""
        by_stop = (modes[:, None, :, None] * np.eye(6)[:, None, :]).reshape(len(modes), 6, -1)
        return cls(by_stop, np.tile(np.repeat([False, True], 3), modes.shape[1]))


class SharedTerm(NamedTuple):
    """Errors of one kind that the stops of robots share, by robot, and the prior of their sigmas."""

    errors: Mapping[str, SharedErrors]
    prior: SharedPrior
