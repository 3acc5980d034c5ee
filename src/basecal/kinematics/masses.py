"""What hangs on the joints of an arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.errors import InputError
from basecal.geometry import Array, read_only


@dataclass(frozen=True, eq=False)
class Masses:
    """What hangs rigidly on each joint of a chain, n of them; the last has what the flange carries too.

    Attributes:
        kg: (n,).
        centres: (n, 3) centres of mass in the joints' own frames, which turn with them [m].

    Raises:
        InputError: if a shape is not as above, or a mass negative.
    """

    kg: Array
    centres: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "kg", read_only(self.kg, (None,), "kg"))
        object.__setattr__(self, "centres", read_only(self.centres, (len(self.kg), 3), "centres"))
        if np.any(self.kg < 0):
            raise InputError("masses are not negative")
