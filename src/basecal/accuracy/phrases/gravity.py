"""Description of the assumed direction of gravity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Cell
from basecal.estimation.solve import Solution
from basecal.geometry import Array

_LEVEL_DEG = 10.0  # largest tilt between two upright bases; assumed
_AXIS_TOLERANCE = 1e-9  # rounding of a unit vector along an axis


def describe_gravity(cell: Cell, solution: Solution, robots: Sequence[str]) -> str:
    """Describe the assumed direction of gravity in the bases of robots, and whether the estimated bases contradict it.

    Args:
        cell: The cell.
        solution: Solution of a problem in which the chains of these robots have masses.
        robots: Names of the robots.
    """
    downs = {name: chain.masses.down for name, chain in solution.problem.chains.items() if chain.masses is not None}
    where = " and ".join(f"{_axis_name(downs[robot])} of {robot}_base" for robot in robots)
    assumption = f"Gravity is assumed along {where}."
    bases = solution.state.transforms
    in_world = [
        down if name == cell.reference else bases[cell.base_name(name)].rotation @ down
        for name, down in downs.items()
        if name == cell.reference or cell.base_name(name) in bases
    ]
    cosines = [first @ second for first in in_world for second in in_world]
    apart = float(np.degrees(np.arccos(np.clip(min(cosines, default=1.0), -1, 1))))
    if apart < _LEVEL_DEG:
        return assumption
    entry = "`deflection: {down: [x, y, z]}`"
    return f"{assumption} In the answer, it differs by {apart:.0f} deg between the arms: if it is wrong, state {entry}."


def _axis_name(direction: Array) -> str:
    """Name of an axis, such as "-z", or else the three components of the direction."""
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > 1 - _AXIS_TOLERANCE:
        return f"{'-' if direction[axis] < 0 else '+'}{'xyz'[axis]}"
    return f"({', '.join(f'{number:.2g}' for number in direction)})"
