"""Tests of a target's points and their ids."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.target import Marker, Sheet, Tags, Target, black_squares
from basecal.errors import InputError

TARGET = Target("points", np.array([2, 5, 9]), np.eye(3))


def test_rows_of_point_ids():
    """Rows are found for ids in any order and repeated; an unknown id is an error that states the range of ids."""
    assert TARGET.rows(np.array([9, 2, 9])).tolist() == [2, 0, 2]
    for unknown in (1, 3, 10):
        with pytest.raises(InputError, match=f"id {unknown} is not on the points, whose ids are 2 to 9"):
            TARGET.rows(np.array([2, unknown]))


def test_single_point_target_is_point():
    """A target of one point has no rotation and is a point; a larger one is not."""
    assert not TARGET.is_point
    assert Target("led", np.zeros(1), np.zeros((1, 3))).is_point


def test_target_copies_its_points():
    """The points are a read-only copy, of three numbers each."""
    points = np.eye(3)
    made = Target("points", np.arange(3), points)
    points[0, 0] = 7
    assert made.points[0, 0] == 1
    assert not made.ids.flags.writeable
    with pytest.raises(InputError, match="points_m has shape"):
        Target("points", np.arange(3), np.zeros((3, 2)))


@pytest.mark.parametrize("parity", [0, 1])
def test_squares_of_one_colour_cover_half_board(parity):
    """Squares of one colour touch only at corners; both colours together cover the board."""
    squares = black_squares(5, 4, 0.1, parity)
    assert len(squares) == 10
    np.testing.assert_allclose(squares[:, 2:] - squares[:, :2], 0.1)
    places = np.rint(squares[:, :2] / 0.1).astype(int)
    assert set((places.sum(1) % 2).tolist()) == {parity}
    assert len({tuple(p) for p in places.tolist()}) == 10
    assert (places.min(0).tolist(), places.max(0).tolist()) == ([0, 0], [4, 3])


def test_empty_sheet_has_no_shapes():
    """An empty sheet has rectangles of four numbers, discs of three, no markers, and the target's pose."""
    sheet = Sheet(np.array([0.0, 0.0, 1.0, 1.0]), 0.1)
    assert (sheet.rectangles.shape, sheet.discs.shape, sheet.markers) == ((0, 4), (0, 3), ())
    np.testing.assert_array_equal(sheet.target_from_sheet.matrix, np.eye(4))


def test_first_square_is_black():
    """The default corner square is black and its neighbours are white; another parity swaps the colours."""
    np.testing.assert_allclose(black_squares(2, 2, 0.1), [[0, 0, 0.1, 0.1], [0.1, 0.1, 0.2, 0.2]])
    np.testing.assert_allclose(black_squares(2, 1, 0.1, 1), [[0.1, 0, 0.2, 0.1]])


def test_marker_defaults():
    """A marker has one cell of border and is upright unless stated otherwise."""
    marker = Marker("DICT_4X4_50", 3, 0.0, 0.0, 0.1)
    assert (marker.border, marker.turns) == (1, 0)


def test_tag_and_target_defaults() -> None:
    """Tags have one cell of border and no squares; a target has no sheets and no half-turn symmetry."""
    tags = Tags("tag36h11", np.arange(1), np.arange(4)[None])
    assert (tags.border, tags.squares) == (1, 0)
    assert (TARGET.sheets, TARGET.tags, TARGET.found_by, TARGET.has_half_turn_symmetry) == ((), None, None, False)
