"""Tests of chessboards."""

from __future__ import annotations

import numpy as np

from basecal.cell.targets.chessboard import chessboard_target

BOARD = chessboard_target((4, 3), 0.1)


def test_inner_corners_run_row_by_row():
    """Corners run from the origin along x, then along y, in the plane z = 0."""
    assert BOARD.ids.tolist() == list(range(12))
    np.testing.assert_allclose(BOARD.points[[0, 1, 4, 11]], [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.3, 0.2, 0]])
    assert BOARD.options == {"corners": [4, 3], "square_m": 0.1}


def test_four_squares_meet_at_each_corner():
    """Two opposite squares of the four around each corner are black; the first square is black."""
    (sheet,) = BOARD.sheets
    low, high = sheet.rectangles[:, :2], sheet.rectangles[:, 2:]

    def is_black(at):
        return bool(np.any(np.all((low < at) & (at < high), axis=1)))

    for corner in BOARD.points[:, :2]:
        around = [is_black(corner + 0.05 * np.array(d)) for d in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        assert around in ([True, False, True, False], [False, True, False, True])
    assert is_black(np.array([-0.05, -0.05]))
    np.testing.assert_allclose([low.min(0), high.max(0)], [[-0.1, -0.1], [0.4, 0.3]], atol=1e-12)
    np.testing.assert_allclose(sheet.paper, [-0.2, -0.2, 0.5, 0.4])
