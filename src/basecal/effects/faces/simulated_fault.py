"""A fault of a simulated cell that runs, as it is switched on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from basecal.geometry import Array, Camera

DEGREE, MILLI, SECOND, ONE = math.radians(1), 1e-3, 1.0, 1.0


@dataclass(frozen=True)
class SimulatedFault:
    """A fault that can be switched on.

    Attributes:
        name: Such as `joint-offsets`.
        unit: Of its size as it is written.
        scale: The unit, in SI.
        usual: Its size if none is given.
        about: What it does, in words.
        is_sudden: Whether it occurs at a moment, after a number of moves of the arm.
        draw: Values of a robot's parameter of this size, of so many joints, if it is one.
        draw_lens: The true lens by the stated one, if it is a lens's.
        move_mount: By which tangent of the flange, (6,), a mount moves, if it is a mount's. Arguments: its size, and
            the direction of gravity in the flange, (3,).
    """

    name: str
    unit: str
    scale: float
    usual: float
    about: str
    is_sudden: bool = False
    draw: Callable[[float, int, np.random.Generator], Array] | None = None
    draw_lens: Callable[[float, Camera], Camera] | None = None
    move_mount: Callable[[float, Array], Array] | None = None
