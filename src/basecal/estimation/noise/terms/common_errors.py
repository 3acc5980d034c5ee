"""Errors that a robot's stops have in common: unit errors, of one sigma for shifts and one for turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.geometry import Array, BoolArray


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

    @classmethod
    def in_every_coordinate(cls, modes: Array) -> CommonErrors:
        """Errors of each coordinate by modes, (stops, j): what a unit error of each is at each stop."""
        by_stop = (modes[:, None, :, None] * np.eye(6)[:, None, :]).reshape(len(modes), 6, -1)
        return cls(by_stop, np.tile(np.repeat([False, True], 3), modes.shape[1]))
