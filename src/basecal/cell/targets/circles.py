"""Grids of circles; all but asymmetric ones with an odd number of rows look the same after a rotation of 180 deg."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from basecal.cell.target import Sheet, Target
from basecal.cell.targets.kind import KindDescription, TargetEntry, TargetKind, plane_grid
from basecal.fields.values import Corners, Length

RADIUS = 0.25
"""Radius of a circle in units of the spacing; half of the spacing stays white, as OpenCV's blob detector needs."""


def circles_target(circles: Sequence[int], spacing_m: float, asymmetric: bool = False) -> Target:
    """Target of (columns, rows) circles; ids are row-major, the origin is circle 0.

    In an asymmetric grid every second row is shifted by half a column pitch of twice `spacing_m`, as in OpenCV.
    """
    columns, rows = circles
    grid = plane_grid(columns, rows, spacing_m)
    if asymmetric:
        row = np.repeat(np.arange(rows), columns)
        grid[:, 0] = 2 * grid[:, 0] + (row % 2) * spacing_m
    low, high = grid[:, :2].min(axis=0) - spacing_m, grid[:, :2].max(axis=0) + spacing_m
    discs = np.column_stack([grid[:, :2], np.full(len(grid), RADIUS * spacing_m)])
    return Target(
        "circles",
        np.arange(len(grid)),
        grid,
        {"circles": [columns, rows], "spacing_m": spacing_m, "asymmetric": asymmetric},
        sheets=(Sheet(np.concatenate([low, high]), spacing_m, discs=discs),),
        found_by="circles",
        has_half_turn_symmetry=not asymmetric or rows % 2 == 0,
    )


class CirclesEntry(TargetEntry):
    """A grid of circles."""

    kind: Literal["circles"]
    circles: Corners
    spacing_m: Length
    asymmetric: bool = False

    def shape(self) -> Target:
        """Return the target."""
        return circles_target(self.circles, self.spacing_m, self.asymmetric)


KIND = TargetKind(
    entries=(CirclesEntry,),
    description=KindDescription(
        "`circles: [columns, rows]`, `spacing_m`, `asymmetric`; dark or bright", "row by row", "circle 0"
    ),
    template="""\
    kind: circles
    circles: [7, 5]                  # columns, rows; ids run row by row from the first
    spacing_m: 0.03                  # centre to centre; measure it
    asymmetric: false
""",
    usual=lambda _: circles_target((7, 6), 0.03),
    printed=lambda sizes: {"circles": [sizes.columns, sizes.rows], "spacing_m": sizes.square_m},
    marks=lambda fields: frozenset({str(sorted(fields["circles"]))}),
    figures={
        "circles": circles_target((4, 3), 0.04),
        "circles_asymmetric": circles_target((3, 4), 0.025, asymmetric=True),
    },
)
