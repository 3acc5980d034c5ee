"""Tests of grids of circles."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.circles import circles_target


def test_circles_run_row_by_row():
    """Circles run from the origin along x, then y, half a spacing in diameter with a spacing of paper around."""
    grid = circles_target((4, 3), 0.1)
    np.testing.assert_allclose(grid.points[[0, 1, 4, 11]], [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.3, 0.2, 0]])
    (sheet,) = grid.sheets
    np.testing.assert_allclose(sheet.discs, np.column_stack([grid.points[:, :2], np.full(12, 0.025)]))
    np.testing.assert_allclose(sheet.paper, [-0.1, -0.1, 0.4, 0.3])
    assert grid.has_half_turn_symmetry
    assert grid.options == {"circles": [4, 3], "spacing_m": 0.1, "asymmetric": False}


def test_odd_rows_of_asymmetric_grid_are_shifted():
    """Columns are two spacings apart and odd rows are shifted by one, so nearest neighbours are diagonal."""
    grid = circles_target((3, 4), 0.1, asymmetric=True)
    np.testing.assert_allclose(
        grid.points[[0, 1, 3, 4, 6]], 0.1 * np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [3, 1, 0], [0, 2, 0]])
    )
    np.testing.assert_allclose(grid.sheets[0].paper, [-0.1, -0.1, 0.6, 0.4])


@pytest.mark.parametrize("asymmetric", [False, True])
@pytest.mark.parametrize("circles", [(3, 4), (4, 3), (4, 11), (5, 6)])
def test_half_turn_symmetry_matches_points(circles: tuple[int, int], asymmetric: bool):
    """A half turn maps point k to point n - 1 - k; asymmetric grids have that symmetry if their row count is even."""
    grid = circles_target(circles, 0.1, asymmetric)
    turned = 2 * grid.points.mean(0) - grid.points[::-1]
    assert grid.has_half_turn_symmetry == np.allclose(turned, grid.points)
