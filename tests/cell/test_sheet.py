"""What is printed of a target."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.sheet import Marker, Sheet, black_squares


@pytest.mark.parametrize("parity", [0, 1])
def test_squares_of_one_colour_cover_half_the_board(parity):
    """They do not touch but at corners; both colours together are the board."""
    squares = black_squares(5, 4, 0.1, parity)
    assert len(squares) == 10
    np.testing.assert_allclose(squares[:, 2:] - squares[:, :2], 0.1)
    places = np.rint(squares[:, :2] / 0.1).astype(int)
    assert set((places.sum(1) % 2).tolist()) == {parity}
    assert len({tuple(p) for p in places.tolist()}) == 10
    assert (places.min(0).tolist(), places.max(0).tolist()) == ([0, 0], [4, 3])


def test_an_empty_sheet_has_no_shapes():
    """Rectangles of four numbers, discs of three, no markers, where the target is."""
    sheet = Sheet(np.array([0.0, 0.0, 1.0, 1.0]), 0.1)
    assert (sheet.rectangles.shape, sheet.discs.shape, sheet.markers) == ((0, 4), (0, 3), ())
    np.testing.assert_array_equal(sheet.target_from_sheet.matrix, np.eye(4))


def test_a_board_begins_with_black():
    """Unless another parity is asked for, the corner square is black and its neighbours are white."""
    np.testing.assert_allclose(black_squares(2, 2, 0.1), [[0, 0, 0.1, 0.1], [0.1, 0.1, 0.2, 0.2]])
    np.testing.assert_allclose(black_squares(2, 1, 0.1, 1), [[0.1, 0, 0.2, 0.1]])


def test_a_marker_has_one_cell_of_border_and_is_upright():
    """Unless something else is said."""
    marker = Marker("DICT_4X4_50", 3, 0.0, 0.0, 0.1)
    assert (marker.border, marker.turns) == (1, 0)
