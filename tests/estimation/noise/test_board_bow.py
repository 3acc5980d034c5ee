"""Boards that are bowed: by how much their points leave the plane."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.noise.board_bow import bow_of, height_m

BOARD = chessboard_target((9, 6), 0.04)


def test_shape_moves_points_off_their_plane_alone():
    """By the square of the place over the half size: 0.3 % of it at the end of the longer side."""
    shape = bow_of(BOARD.points)
    np.testing.assert_allclose(shape[:, :2, :], 0.0, atol=1e-12)
    assert np.abs(shape[:, 2, :]).max() == pytest.approx(3e-3 * 0.16, rel=1e-6)


def test_height_is_that_off_the_points_own_plane():
    """Tilt and shift of the surface do not count: a twist of one sigma lifts the corner (1, 5/8) by its product."""
    assert height_m(BOARD.points, np.array([0.0, 1.0, 0.0])) == pytest.approx(3e-3 * 0.16 * 5 / 8, rel=1e-6)
