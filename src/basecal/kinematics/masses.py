"""Masses that hang on the joints of an arm."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from basecal.errors import InputError
from basecal.geometry import Array, read_only


@dataclass(frozen=True, eq=False)
class Masses:
    """Masses that hang rigidly on each joint of a chain, n of them; the last has what the flange carries too.

    Attributes:
        kg: (n,).
        centres: (n, 3) centres of mass in the joints' own frames, which turn with them [m].
        down: (3,) along gravity, of any length, in the chain's base; its -z where nothing else is known.

    Raises:
        InputError: if a shape is not as above, a mass negative, or down no direction.
    """

    kg: Array
    centres: Array
    down: Array = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))

    def __post_init__(self) -> None:
        object.__setattr__(self, "kg", read_only(self.kg, (None,), "kg"))
        object.__setattr__(self, "centres", read_only(self.centres, (len(self.kg), 3), "centres"))
        if np.any(self.kg < 0):
            raise InputError("masses are not negative")
        length = float(np.linalg.norm(self.down))
        if not length > 0:
            raise InputError("down is the direction of gravity in the base of the arm, not zero")
        object.__setattr__(self, "down", read_only(np.asarray(self.down) / length, (3,), "down"))
