"""Directions of transforms that nothing depends on: a plate about the line of its marks, a plane within itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Cell
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.contacts import ContactMeasurement
from basecal.geometry import Array
from basecal.numerics.spectral import principal_axes


def held_gauges(cell: Cell, groups: Sequence[ViewGroup]) -> dict[str, Array]:
    """Directions of tangents that are held, of each transform that has some and is not fixed: 1, else 0, (6,)."""
    found = {cell.plate_name(plate): _line_rotation(cell, plate) for plate in cell.plates}
    for group in groups:
        if isinstance(group.measurement, ContactMeasurement):
            found[group.eye.mount] = np.array(group.measurement.camera_gauge, dtype=np.float64)
            found[group.hand.mount] = np.array(group.measurement.target_gauge, dtype=np.float64)
    unknowns = cell.transforms
    return {name: of for name, of in found.items() if of.any() and unknowns[name].status != "fixed"}


def _line_rotation(cell: Cell, plate: str) -> Array:
    """The rotation of a plate about the line that all its marks are on, if they are."""
    places = [target.mount.mean for target in cell.targets.values() if target.on == plate]
    points = np.array([at.translation for at in places if at is not None])
    of, held = principal_axes(points - points.mean(0)), np.zeros(6)
    if of.dimension == 1:
        held[3 + int(np.argmax(np.abs(of.axes[:, 0])))] = 1.0
    return held
