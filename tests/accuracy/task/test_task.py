"""Tests of task places and of the transforms placed in the reference."""

from __future__ import annotations

import pytest

from basecal.accuracy.task.task import box_points, place_kind, placed_transforms, require_placed_transforms, task_places
from basecal.errors import InputError
from basecal.simulation import Scenario, simulate


def test_placed_transforms_of_cells():
    """Placed transforms are bases of robots, else devices on the world; a mount on a flange alone has none."""
    assert require_placed_transforms(simulate(Scenario(samples=2), 0).cell) == ["eye_base_from_hand_base"]
    assert require_placed_transforms(simulate(Scenario(samples=2, layout="eye_in_hand"), 0).cell) == [
        "arm_base_from_board"
    ]
    lone = simulate(Scenario(samples=2, layout="eye_in_hand", target_mount="fixed"), 0).cell
    with pytest.raises(InputError, match="task point"):
        require_placed_transforms(lone)
    assert placed_transforms(lone) == []


def test_task_places_of_point_and_box():
    """Task places are a point, or the middle and corners of a box, or none."""
    box = (0.0, -1.0, 2.0, 1.0, 1.0, 4.0)
    assert task_places(None, None).shape == (0, 3)
    assert task_places((1.0, 2.0, 3.0), None).tolist() == [[1, 2, 3]]
    assert task_places((1.0, 2.0, 3.0), box).tolist() == [list(point) for point in box_points(box)]
    assert box_points(box)[0] == (0.5, 0.0, 3.0)
    assert set(box_points(box)[1:]) == {(x, y, z) for x in (0, 1) for y in (-1, 1) for z in (2, 4)}


def test_box_has_middle_and_corners():
    """A box has a middle and eight corners, for any opposite corners.

    The kind of a task follows from its point count.
    """
    middle, *corners = box_points((0.0, 2.0, 10.0, 1.0, 4.0, 6.0))
    assert middle == (0.5, 3.0, 8.0)
    assert len(corners) == 8
    assert set(corners) == {(x, y, z) for x in (0.0, 1.0) for y in (2.0, 4.0) for z in (10.0, 6.0)}
    for point, box, kind, count in (
        (None, None, "recorded places", 0),
        ((1.0, 2.0, 3.0), None, "task point", 1),
        (None, (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), "task box", 9),
    ):
        places = task_places(point, box)
        assert places.shape == (count, 3)
        assert place_kind(places) == kind
