"""Errors that a robot's stops have in common: unit errors, of one sigma for shifts and one for turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.geometry import SE3, Array, BoolArray
from basecal.numerics.spectral import pseudo_inverse

_ARM_M = 0.5  # what angles count as, beside lengths [m/rad]


@dataclass(frozen=True, eq=False)
class CommonErrors:
    """What a robot's stops have in common.

    Attributes:
        by_stop: (stops, 6, k) how the flange at each stop moves with each error, right tangents.
        is_turn: (k,) whether an error goes by the sigma of turns [rad]; the others go by that of shifts [m].
    """

    by_stop: Array
    is_turn: BoolArray

    def at_flange(self, sigmas: Array) -> Array:
        """What sigmas of a shift and of a turn, (2,), come to at the flange, (6,): the root mean square over stops."""
        scaled = self.by_stop * sigmas[self.is_turn.astype(np.int64)]
        return np.asarray(np.sqrt(np.mean(np.sum(scaled**2, axis=-1), axis=0)))

    def beyond_frames(self, poses: SE3) -> CommonErrors:
        """What of them no base and no mount takes up that is free.

        Args:
            poses: Of the flange at each stop, (stops,).
        """
        units = np.repeat([1.0, _ARM_M], 3)
        frames = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (len(poses), 6, 6))], axis=-1)
        by_frames = (units[:, None] * frames).reshape(-1, 12)
        flat = (units[:, None] * self.by_stop).reshape(len(by_frames), -1)
        left = flat - by_frames @ (pseudo_inverse(by_frames) @ flat)
        return replace(self, by_stop=left.reshape(self.by_stop.shape) / units[:, None])

    @classmethod
    def in_every_coordinate(cls, modes: Array) -> CommonErrors:
        """Errors of each coordinate by modes, (stops, j): what a unit error of each is at each stop."""
        by_stop = (modes[:, None, :, None] * np.eye(6)[:, None, :]).reshape(len(modes), 6, -1)
        return cls(by_stop, np.tile(np.repeat([False, True], 3), modes.shape[1]))
