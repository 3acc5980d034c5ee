"""Errors that a robot's stops share: unit errors, with one sigma for translations and one for rotations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.numerics.spectral import pseudo_inverse

_ARM_M = 0.5  # lever that converts angles to lengths [m/rad]
TIE = 1.05
"""Prior factor of a translation over reach times rotation: a looser one splits shared errors wrongly between the two.
"""


class SharedPrior(NamedTuple):
    """Prior of the two sigmas of errors that a robot's stops share.

    Attributes:
        turn: Median of the sigma of rotations, and the factor of one standard deviation.
        source: Source of the numbers, or `assumed`.
        is_over_stop: Whether `turn` is relative to the sigma of single stops; otherwise it is in radians.
        lever: Median of translation over rotation [m] (the robot's reach if None), and the factor.
        tie: Factor for single stops' translations over reach times rotations, when these errors are modelled too.
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
"""Prior of the errors of each joint and link of an arm that differs from its statement.

Factory calibrations show the errors of a type's URDF. Those of fifteen arms of Universal Robots are in public
repositories. Their rotations are 1.2 mrad within a factor of 1.9, equal over joints and links; their translations are
0.1 m times the rotations. Two Motoman MA1400 have 1.2 mrad and 0.65 mm. An accuracy of 0.5 to 2 mm results from
0.8 mrad (Nubiola & Bonev 2013). A tenth of it (calibrated arms) and 7 mrad (hobbyists' arms) are within 1.5 standard
deviations.
"""


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Errors that a robot's stops share.

    Attributes:
        by_stop: (stops, 6, k) derivative of the flange at each stop with respect to each error, right tangents.
        is_turn: (k,) whether an error has the sigma of rotations [rad]; the others have that of translations [m].
    """

    by_stop: Array
    is_turn: BoolArray

    def flange_sigmas(self, sigmas: Array) -> Array:
        """Sigmas at the flange, (6,), root mean square over stops, from those of translation and rotation, (2,)."""
        scaled = self.by_stop * sigmas[self.is_turn.astype(np.int64)]
        return np.asarray(np.sqrt(np.mean(np.sum(scaled**2, axis=-1), axis=0)))

    def remove_frames(self, poses: SE3) -> SharedErrors:
        """The part of the errors that no free base and no free mount absorbs.

        Args:
            poses: Poses of the flange at each stop, (stops,).
        """
        units = np.repeat([1.0, _ARM_M], 3)
        frames = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (len(poses), 6, 6))], axis=-1)
        by_frames = (units[:, None] * frames).reshape(-1, 12)
        flat = (units[:, None] * self.by_stop).reshape(len(by_frames), -1)
        left = flat - by_frames @ (pseudo_inverse(by_frames) @ flat)
        return replace(self, by_stop=left.reshape(self.by_stop.shape) / units[:, None])

    def rotate_to(self, poses: SE3, axes: Array | None = None) -> SharedErrors:
        """A copy along axes in the base instead of the flange's; `axes` is (stops, 3, 3), the base's own if None."""
        flange_from_axes = poses.rotation.mT if axes is None else poses.rotation.mT @ axes
        return replace(self, by_stop=np.kron(np.eye(2), flange_from_axes) @ self.by_stop)

    @classmethod
    def repeat_coordinates(cls, modes: Array) -> SharedErrors:
        """Errors of each coordinate with the same modes, (stops, j): the value of a unit error at each stop."""
        by_stop = (modes[:, None, :, None] * np.eye(6)[:, None, :]).reshape(len(modes), 6, -1)
        return cls(by_stop, np.tile(np.repeat([False, True], 3), modes.shape[1]))


class SharedTerm(NamedTuple):
    """Errors of one kind that the stops of each robot share, and the prior of their sigmas."""

    errors: Mapping[str, SharedErrors]
    prior: SharedPrior
