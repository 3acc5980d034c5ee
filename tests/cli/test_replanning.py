"""Tasks that a capture is planned for while it goes on."""

from __future__ import annotations

import pytest

from basecal.cli.replanning import Task, requested_task
from basecal.errors import UsageError


def test_a_task_is_a_place_and_a_tolerance() -> None:
    """A point is one place, a box nine; lengths are metres."""
    assert requested_task((0.5, 0.0, 0.3), None, "0.3mm") == Task([(0.5, 0.0, 0.3)], pytest.approx(3e-4))
    box = requested_task(None, (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), "1mm")
    assert box is not None
    assert len(box.points_m) == 9
    assert requested_task(None, None, None) is None


def test_half_a_task_is_refused() -> None:
    """Neither a place nor a tolerance says when to end by itself."""
    for words in ((None, None, "1mm"), ((0.5, 0.0, 0.3), None, None), ((0.0,) * 3, (0.0,) * 6, "1mm")):
        with pytest.raises(UsageError):
            requested_task(*words)
