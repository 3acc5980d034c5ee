"""Grids that go on."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array
from basecal.vision.kinds.circles import detect
from basecal.vision.kinds.whole_grid import has_further_row
from vision_scenes import TARGETS, WIDE, at, scene, shrunk

SHAPE = TARGETS["circles"]
IMAGE = scene(SHAPE)


def grid() -> Array:
    return WIDE.project(at(SHAPE) @ SHAPE.points).reshape(5, 8, 2)


def test_the_whole_grid_ends() -> None:
    """A grid that was found whole goes on nowhere, whichever way it is read."""
    for whole in (grid(), grid()[::-1], grid()[:, ::-1], grid().swapaxes(0, 1)):
        assert not has_further_row(IMAGE, whole)


@pytest.mark.parametrize("part", [np.s_[1:], np.s_[:-1], np.s_[:, 1:], np.s_[:, :-1], np.s_[1:4, 2:6]])
def test_a_part_goes_on(part: object) -> None:
    """Without a row or column on any side, the grid goes on there."""
    assert has_further_row(IMAGE, grid()[part])


def test_rows_beyond_the_image_do_not_count() -> None:
    """Where the next row would be outside the image, nothing is known of it."""
    upright = SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    places = WIDE.project(at(SHAPE, upright) @ SHAPE.points).reshape(5, 8, 2)
    image = scene(SHAPE, pose=upright)
    assert has_further_row(image, places[:, :-1])
    assert not has_further_row(image[:, : int(places[:, -2, 0].max()) + 8], places[:, :-1])


@pytest.mark.parametrize("size", [(7, 5), (8, 4), (4, 4)])
def test_fewer_circles_than_printed_are_none(size: tuple[int, int]) -> None:
    """A target stated with fewer circles than it has is not found: which of them were seen would change."""
    image = shrunk(IMAGE, 2)
    assert detect(image, SHAPE) is not None
    assert detect(image, circles_target(size, 0.03)) is None
