"""ChArUco boards: a chessboard with a marker in each white square, in OpenCV's layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import model_validator as checks_whole

from basecal.cell.target import Marker, Sheet, Target, black_squares
from basecal.cell.targets.fiducials import DICTIONARIES, series_name, smallest_dictionary
from basecal.cell.targets.kind import Fields, KindDescription, TargetEntry, TargetKind, choose_dictionary, plane_grid
from basecal.fields.values import Length, Squares, known_name_validator

# White margin in squares: separates the outer squares from the background.
_MARGIN_SQUARES = 0.5


def charuco_target(
    squares: Sequence[int], square_m: float, marker_m: float, dictionary: str, legacy_pattern: bool = False
) -> Target:
    """ChArUco target of (columns, rows) squares; ids are OpenCV's corner ids, the origin is the outer corner."""
    columns, rows = squares
    points = plane_grid(columns - 1, rows - 1, square_m, origin=square_m)
    return Target(
        "charuco",
        np.arange(len(points)),
        points,
        {
            "squares": [columns, rows],
            "square_m": square_m,
            "marker_m": marker_m,
            "dictionary": dictionary,
            "legacy_pattern": legacy_pattern,
        },
        sheets=(_sheet(columns, rows, square_m, marker_m, dictionary, legacy_pattern),),
        found_by="charuco",
    )


def _sheet(columns: int, rows: int, square_m: float, marker_m: float, dictionary: str, legacy: bool) -> Sheet:
    """Printed board with markers numbered row by row; a legacy pattern with an even row count starts with a marker."""
    parity = int(legacy and rows % 2 == 0)
    white = black_squares(columns, rows, square_m, 1 - parity)[:, :2] + (square_m - marker_m) / 2
    markers = tuple(Marker(dictionary, k, left, top, marker_m) for k, (left, top) in enumerate(white.tolist()))
    paper = square_m * np.array([-_MARGIN_SQUARES, -_MARGIN_SQUARES, columns + _MARGIN_SQUARES, rows + _MARGIN_SQUARES])
    return Sheet(paper, square_m, black_squares(columns, rows, square_m, parity), markers=markers)


class CharucoEntry(TargetEntry):
    """A ChArUco board."""

    kind: Literal["charuco"]
    squares: Squares
    square_m: Length
    marker_m: Length
    dictionary: Annotated[str, known_name_validator("dictionary", DICTIONARIES)]
    legacy_pattern: bool = False

    @checks_whole(mode="after")
    def _marker_fits(self) -> CharucoEntry:
        if self.marker_m >= self.square_m:
            raise ValueError(f"marker_m {self.marker_m} is not below square_m {self.square_m}")
        return self

    def shape(self) -> Target:
        """Return the target."""
        return charuco_target(self.squares, self.square_m, self.marker_m, self.dictionary, self.legacy_pattern)


# Dictionaries for several boards in a cell, in the order of use: no two share a marker.
_DICTIONARIES = (
    *(f"DICT_{n}X{n}_50" for n in (4, 5, 6, 7)),
    *(f"DICT_APRILTAG_{code}" for code in ("36h11", "36h10", "25h9")),
    "DICT_ARUCO_MIP_36h12",
)


def _other_dictionaries(fields: Fields) -> list[str]:
    """Dictionaries that are large enough for this board and share no marker with its own dictionary."""
    columns, rows = fields["squares"]
    others = [name for name in _DICTIONARIES if series_name(name) != series_name(fields["dictionary"])]
    return [smallest_dictionary(name, columns * rows // 2) for name in others]


KIND = TargetKind(
    entries=(CharucoEntry,),
    description=KindDescription(
        "`squares: [columns, rows]`, `square_m`, `marker_m`, `dictionary`, `legacy_pattern`",
        "OpenCV's corner id",
        "outer corner of the first square",
    ),
    template="""\
    kind: charuco
    squares: [5, 7]                  # columns, rows of squares; ids are OpenCV's ChArUco corner ids
    square_m: 0.04                   # measure it: the scale of the answer is the scale of the board
    marker_m: 0.03
    dictionary: DICT_4X4_50
""",
    usual=lambda _: charuco_target((7, 7), 0.03, 0.022, "DICT_4X4_50"),
    printed=lambda sizes: {
        "squares": [sizes.columns, sizes.rows],
        "square_m": sizes.square_m,
        "marker_m": sizes.marker_m,
        "dictionary": sizes.dictionary,
    },
    marks=lambda fields: frozenset({series_name(fields["dictionary"])}),
    numbered_fields=lambda fields, n: {
        **fields,
        "dictionary": choose_dictionary(_other_dictionaries(fields), fields["dictionary"], n),
    },
    figures={"charuco": charuco_target((5, 4), 0.04, 0.03, "DICT_4X4_50")},
)
