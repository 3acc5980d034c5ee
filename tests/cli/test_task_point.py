"""Places where the work is done."""

from __future__ import annotations

import pytest

from basecal.cli.task_point import task_points
from basecal.errors import InputError, UsageError

BOX = (0.6, -0.2, 0.1, 1.0, 0.2, 0.5)


def test_a_point_or_a_box():
    """A box counts by its middle first, then by its corners."""
    assert task_points((1.0, 2.0, 3.0), None) == [(1.0, 2.0, 3.0)]
    points = task_points(None, BOX)
    assert points[0] == pytest.approx((0.8, 0.0, 0.3))
    assert {BOX[:3], BOX[3:]} < set(points[1:])


@pytest.mark.parametrize(("point", "box"), [(None, None), ((1.0, 2.0, 3.0), BOX)])
def test_neither_and_both_are_refused(point, box):
    with pytest.raises(UsageError, match="either --task-point x y z or --task-box"):
        task_points(point, box)


def test_a_box_of_no_volume_is_refused():
    """Before anything is read: no sample is inside."""
    with pytest.raises(InputError, match="differ in x, in y and in z"):
        task_points(None, (0.6, -0.2, 0.1, 1.0, 0.2, 0.1))
