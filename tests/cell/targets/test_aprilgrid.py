"""Tests of Kalibr's aprilgrid: the positions of its points, and agreement of the print with Kalibr's."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.files import cell_from_dict
from basecal.cell.targets.aprilgrid import KIND, aprilgrid_target
from basecal.cell.targets.kind import PrintSizes
from basecal.errors import DatasetError
from basecal.geometry import SE3, Array
from basecal.vision.detectors import find_target
from basecal.vision.draw.drawing import target_drawing
from basecal.vision.draw.render import RenderSettings, render
from vision_scenes import WIDE

# The 36 bits of tag 0 of tag36h11 as AprilTag publishes them: row by row from the top left, 1 is white.
TAG_0 = 0xD5D628584


def test_grid_points_match_kalibr() -> None:
    """A corner of tag (column, row) is at column and row times (1 + spacing) tags, plus at most one tag."""
    grid = aprilgrid_target((3, 2), 0.1, 0.25)
    assert len(grid.ids) == 24
    np.testing.assert_allclose(
        grid.points[grid.rows(np.array([0, 1, 2, 3]))][:, :2], [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]
    )
    # Tag 5 is the last of the second row.
    np.testing.assert_allclose(grid.points[grid.rows(np.array([4 * 5 + 2]))], [[2 * 0.125 + 0.1, 0.125 + 0.1, 0]])


def is_black(places: Array) -> Array:
    """Return whether places of the grid's print, (n, 2) [m] in the target's frame, are black."""
    (sheet,) = target_drawing(aprilgrid_target((2, 2), 0.1, 0.3))
    flat = np.concatenate([places, np.zeros((len(places), 1))], axis=1)
    x, y, _ = (sheet.target_from_sheet.inverse() @ flat).T
    left, top, right, bottom = sheet.rectangles.T
    return ((x[:, None] > left) & (x[:, None] < right) & (y[:, None] > top) & (y[:, None] < bottom)).any(axis=1)


def test_tag_zero_is_upright_at_lower_left() -> None:
    """Tag 0 shows its published bits, top row first with y up, inside two cells of black border."""
    cell = 0.1 / 10
    row, column = (each.ravel() for each in np.mgrid[0:10, 0:10])
    seen = is_black(np.stack([(column + 0.5) * cell, 0.1 - (row + 0.5) * cell], -1)).reshape(10, 10)
    bits = np.array([TAG_0 >> (35 - k) & 1 for k in range(36)]).reshape(6, 6)
    expected = np.ones((10, 10), dtype=bool)
    expected[2:8, 2:8] = bits == 0
    np.testing.assert_array_equal(seen, expected)


def test_squares_touch_every_tag_corner() -> None:
    """Around every corner of a tag the quadrants alternate between black and white; the tag and a square are black."""
    points = aprilgrid_target((2, 2), 0.1, 0.3).points[:, :2]
    around = [is_black(points + 0.004 * np.array(step)) for step in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    np.testing.assert_array_equal(around[0], around[2])
    np.testing.assert_array_equal(around[1], around[3])
    assert not np.any(around[0] == around[1])


def upright_pose(grid_middle: Array, turn: float, depth: float) -> SE3:
    rotation = SE3.from_rpy((0.3, -0.2, turn), np.zeros(3)).rotation @ np.diag([1.0, -1.0, -1.0])
    return SE3(rotation, np.array([0, 0, depth]) - rotation @ grid_middle)


@pytest.mark.journey
@pytest.mark.parametrize("spacing", [0.2, 0.5])
def test_grid_is_detected_with_consistent_sigmas(spacing: float) -> None:
    """Over 95 % of the corners are found, none wrong, with errors as large as their sigmas state."""
    grid = aprilgrid_target((6, 5), 0.03, spacing)
    ratios, count = [], 0
    for seed in range(2):
        pose = upright_pose(grid.points.mean(axis=0), 0.8 * seed, 0.45)
        detection = find_target(render(WIDE, grid, pose, RenderSettings(noise=2.0, blur_px=0.8), seed), grid)
        assert detection is not None
        assert detection.ids is not None
        error = detection.pixels - WIDE.project(pose @ grid.points)[grid.rows(detection.ids)]
        ratios.append((error / detection.sigma_px[:, None]).ravel())
        count += len(detection.ids)
    assert count > 0.95 * 2 * len(grid.ids)
    assert np.abs(np.concatenate(ratios)).max() < 6
    assert 0.8 < np.concatenate(ratios).std() < 1.25


@pytest.mark.journey
def test_partial_grid_is_detected() -> None:
    """The corners of a partly visible grid that are inside the image are found with their own ids."""
    grid = aprilgrid_target((8, 8), 0.04, 0.3)
    pose = upright_pose(grid.points.max(axis=0), 0.1, 0.5)
    true = WIDE.project(pose @ grid.points)
    inside = ((true > 0) & (true < [1280, 720])).all(axis=1)
    assert 0.3 < inside.mean() < 0.9
    detection = find_target(render(WIDE, grid, pose), grid)
    assert detection is not None
    assert detection.ids is not None
    assert len(detection.ids) > 0.7 * inside.sum()
    np.testing.assert_allclose(detection.pixels, true[grid.rows(detection.ids)], atol=0.15)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("tags", [0, 6], "tags"),
        ("spacing", 0, "spacing"),
        ("spacing", 30, "spacing"),
        ("family", "tag36h12", "tag36h11"),
    ],
)
def test_invalid_grids_are_refused(field: str, value: object, message: str) -> None:
    """No tags, a gap of zero or in percent, and an unknown family are errors that name the field."""
    target = {"on": "world", "kind": "aprilgrid", "tags": [6, 6], "tag_m": 0.088, "spacing": 0.3, field: value}
    with pytest.raises(DatasetError, match=message):
        cell_from_dict({"schema": "basecal/cell/1", "reference": "a", "robots": {"a": {}}, "targets": {"t": target}})


@pytest.mark.parametrize(("columns", "rows"), [(2, 3), (4, 2)])
def test_squares_surround_tags_only(columns: int, rows: int) -> None:
    """One square as large as a gap lies at every crossing of the gaps, at the outer corners too.

    All lie on the paper.
    """
    (sheet,) = aprilgrid_target((columns, rows), 0.1, 0.3).sheets
    low, high = sheet.rectangles[:, :2], sheet.rectangles[:, 2:]
    assert len(low) == (columns + 1) * (rows + 1)
    np.testing.assert_allclose(high - low, 0.03)
    np.testing.assert_allclose(np.ptp(low, axis=0), [0.13 * columns, 0.13 * rows])
    assert np.all(low.min(0) > sheet.paper[:2])
    assert np.all(high.max(0) < sheet.paper[2:])
    assert len(sheet.markers) == columns * rows


def test_printed_grid_has_kalibr_spacing() -> None:
    """The gap is 0.3 of a tag, as in Kalibr's own grids."""
    printed = KIND.printed
    assert printed is not None
    assert printed(PrintSizes(4, 3, 0.05, 0.03, "", "tag36h11", 0)) == {
        "tags": [4, 3],
        "tag_m": 0.05,
        "spacing": 0.3,
        "family": "tag36h11",
    }
