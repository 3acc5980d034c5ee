"""Chessboards, sized by their inner corners.

A board looks the same after a rotation of 180 deg if its numbers of corners are both even or both odd.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from basecal.cell.target import Sheet, Target, black_squares
from basecal.cell.targets.kind import KindDescription, TargetEntry, TargetKind, plane_grid
from basecal.fields.values import Corners, Length


def chessboard_target(corners: Sequence[int], square_m: float) -> Target:
    """Target of a chessboard with (columns, rows) inner corners; the origin is corner 0."""
    columns, rows = corners
    points = plane_grid(columns, rows, square_m)
    black = black_squares(columns + 1, rows + 1, square_m) - square_m
    paper = square_m * np.array([-2.0, -2.0, columns + 1, rows + 1])
    return Target(
        "chessboard",
        np.arange(len(points)),
        points,
        {"corners": [columns, rows], "square_m": square_m},
        sheets=(Sheet(paper, square_m, black),),
        found_by="chessboard",
        has_half_turn_symmetry=True,
    )


class ChessboardEntry(TargetEntry):
    """A chessboard, sized by its inner corners."""

    kind: Literal["chessboard"]
    corners: Corners
    square_m: Length

    def shape(self) -> Target:
        """Return the target."""
        return chessboard_target(self.corners, self.square_m)


KIND = TargetKind(
    entries=(ChessboardEntry,),
    description=KindDescription("`corners: [columns, rows]` (inner), `square_m`", "row by row", "corner 0"),
    template="""\
    kind: chessboard
    corners: [8, 6]                  # columns, rows of inner corners; ids run row by row from the first
    square_m: 0.025                  # measure it: the scale of the answer is the scale of the board
""",
    usual=lambda _: chessboard_target((6, 6), 0.03),
    printed=lambda sizes: {"corners": [sizes.columns, sizes.rows], "square_m": sizes.square_m},
    marks=lambda fields: frozenset({str(sorted(fields["corners"]))}),
    figures={"chessboard": chessboard_target((4, 3), 0.04)},
)
