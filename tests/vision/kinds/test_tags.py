"""Tests of the detection of tags in poor images."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.aprilgrid import aprilgrid_target
from basecal.geometry import SE3
from basecal.vision.draw.render import RenderSettings
from basecal.vision.kinds import tags as module
from basecal.vision.kinds.tags import _FoundTags, _grow_grid, _Search, detect
from vision_scenes import DARK, STRAIGHT, TARGETS, WIDE, at, check_poor_image, scene

SHAPE = TARGETS["tags"]
GRID = aprilgrid_target((5, 4), 0.035, 0.3)
POOR = {
    "as they should be": (RenderSettings(), 1, 24),
    "dark": (DARK, 1, 22),
    "blurred": (RenderSettings(blur_px=6.0, noise=1.0), 1, 4),
    "small": (RenderSettings(), 5, 24),
}


@pytest.mark.journey
@pytest.mark.parametrize("how", list(POOR))
def test_tags_are_detected_in_poor_images(how: str) -> None:
    """Dark, blurred or small tags are detected, with sigmas true within a factor of two and a half."""
    check_poor_image(detect, SHAPE, *POOR[how])


@pytest.mark.parametrize("bits", [8, 16])
def test_aprilgrid_corners_are_saddle_points(bits: int) -> None:
    """All corners of Kalibr's grid are found as corners between four fields, to a twentieth of a pixel."""
    front = SE3(STRAIGHT.rotation @ GRID.sheets[0].target_from_sheet.rotation.T, STRAIGHT.translation)
    found = detect(scene(GRID, RenderSettings(bits=bits), front), GRID)
    assert found is not None
    np.testing.assert_array_equal(found.ids, GRID.ids)
    np.testing.assert_allclose(found.pixels, WIDE.project(at(GRID, front) @ GRID.points), rtol=0, atol=0.05)


@pytest.mark.journey
def test_tags_of_other_family_are_not_detected() -> None:
    """Tags of another family, and a target without tags, give no detection."""
    assert detect(scene(SHAPE), TARGETS["aruco"]) is None
    assert detect(scene(SHAPE), TARGETS["chessboard"]) is None


def test_missing_tags_are_searched_outwards(monkeypatch: pytest.MonkeyPatch) -> None:
    """From one tag of a grid its neighbours are searched, then theirs, each where the plane of known tags has it."""
    assert GRID.tags is not None
    corners = GRID.points[GRID.rows(GRID.tags.corner_ids.ravel()), :2].reshape(-1, 4, 2) * 1000 + 50
    rounds: list[list[int]] = []

    def found(rows: np.ndarray, quads: np.ndarray) -> _FoundTags:
        return _FoundTags(rows, quads, np.ones(quads.shape[:2]), np.ones(quads.shape[:2], dtype=bool))

    def fit(search: _Search, rows: np.ndarray, quads: np.ndarray) -> _FoundTags:
        rounds.append(rows.tolist())
        np.testing.assert_allclose(quads, corners[rows], atol=1e-2)
        return found(rows, quads)

    monkeypatch.setattr(module, "_fit_quads", fit)
    first = found(np.array([0]), corners[:1])
    grown = _grow_grid(_Search(np.zeros((9, 9), np.uint8), GRID.tags, 8, 1), GRID, first)
    ring = [max(row // 5, row % 5) for row in range(20)]
    assert rounds == [[row for row in range(20) if ring[row] == k] for k in (1, 2, 3, 4)]
    assert sorted(grown.rows.tolist()) == list(range(20))
