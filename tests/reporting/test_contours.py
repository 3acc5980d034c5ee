"""Tests of contour lines: their geometry, refinement and labels."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.drawings import labels

from basecal.reporting.contours import contours, level_segments, refine


def test_contour_of_plane_is_straight() -> None:
    """The ends of all segments lie where the plane has the level; the segments together cross the grid."""
    x, y = np.meshgrid(np.arange(6.0), np.arange(4.0))
    found = level_segments(2 * x - y, 3.3)
    np.testing.assert_allclose(2 * found[..., 0] - found[..., 1], 3.3, atol=1e-12)
    assert np.linalg.norm(found[:, 1] - found[:, 0], axis=-1).sum() == pytest.approx(np.hypot(3, 1.5))


def test_contour_of_cone_is_closed_circle() -> None:
    """The contour of a cone has the length of a circle and is closed: two segments share each end."""
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    found = (level_segments(np.hypot(x, y), 0.71) - 20) / 20
    np.testing.assert_allclose(np.hypot(found[..., 0], found[..., 1]), 0.71, atol=2e-3)
    assert np.linalg.norm(found[:, 1] - found[:, 0], axis=-1).sum() == pytest.approx(1.42 * np.pi, rel=2e-3)
    _, count = np.unique(np.round(found.reshape(-1, 2), 9), axis=0, return_counts=True)
    assert set(count) == {2}


@pytest.mark.parametrize("count", [2, 3, 7])
def test_refined_grid_interpolates_its_values(count: int) -> None:
    """The refined grid contains the given values.

    A plane is reproduced up to the borders, a parabola in the interior.
    """
    rows = np.arange(float(count))
    fine = np.linspace(0, count - 1, 8 * (count - 1) + 1)
    np.testing.assert_allclose(refine(np.stack([rows, 3 - 2 * rows], axis=1)).T, [fine, 3 - 2 * fine], atol=1e-12)
    curved = refine(np.stack([rows**2, np.cos(rows)], axis=1))
    np.testing.assert_allclose(curved[::8].T, [rows**2, np.cos(rows)], atol=1e-12)
    np.testing.assert_allclose(curved[8:-8, 0], fine[8:-8] ** 2, atol=1e-12)


def test_each_contour_has_one_label() -> None:
    """Contours are at round values between the smallest and the largest, in coordinates of the squares' centres.

    A constant grid has none.
    """
    values = np.add.outer(np.zeros(4), np.arange(6.0))
    drawn = "".join(contours(values, 40.0))
    assert re.findall(r">([\d.]+)</text>", drawn) == ["1", "2", "3", "4"]
    assert {float(x) for x in re.findall(r"[ML]([\d.]+) ", drawn)} == {60.0, 100.0, 140.0, 180.0}
    assert contours(np.ones((4, 6)), 40.0) == []
    assert contours(np.arange(6.0)[None], 40.0) == []


def test_contour_labels_lie_on_lines_without_overlap() -> None:
    """Each label is centred on its contour.

    Contours without enough room have no label, so that no labels overlap, however long the numbers are.
    """
    values = np.add.outer(np.zeros(4), np.arange(6.0))
    drawn = "<svg>" + "".join(contours(values, 40.0)) + "</svg>"
    for box, x in zip(labels(drawn), (60, 100, 140, 180), strict=True):
        assert (box.left + box.right) / 2 == pytest.approx(x)
        assert 10 <= box.top < box.bottom <= 140
    close = "<svg>" + "".join(contours(0.21 + 5e-3 * values, 20.0)) + "</svg>"
    written = re.findall(r'x="([\d.]+)" y="([\d.]+)"[^>]*>([\d.]+)</text>', close)
    assert written
    for k, (x, y, text) in enumerate(written):
        for other_x, other_y, other in written[:k]:
            beside = abs(float(x) - float(other_x)) >= 6.0 * (len(text) + len(other))
            assert beside or abs(float(y) - float(other_y)) >= 22.0


def test_smallest_grid_with_contours_is_two_by_two() -> None:
    """A grid of two rows and two columns has contours.

    A grid with a single column or with a value that is not a number has none.
    """
    assert len(contours(np.array([[0.0, 5.0], [0.0, 5.0]]), 40.0)) > 1
    assert contours(np.array([[0.0], [5.0]]), 40.0) == []
    assert contours(np.array([[0.0, np.nan], [1.0, 5.0]]), 40.0) == []
