"""Tests of a step of a frame from a sample on."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.effects.step import candidates as steps
from made_views import Made


@pytest.mark.parametrize(("count", "since"), [(5, []), (6, [30]), (7, [30, 40]), (10, [30, 40, 50, 60, 70])])
def test_steps_leave_three_samples_on_either_side(count, since):
    """Each step is identified by the number of its first sample."""
    found = list(steps(Made(count)))
    assert [list(each.since) for each in found] == ([since] if since else [])
    assert all(each.about == ("base",) * len(since) for each in found)


def test_long_recordings_have_thirty_two_step_candidates():
    """The places are spread evenly, including the first and the last; up to 37 samples every place is tested."""
    (long,), (most,) = steps(Made(100)), steps(Made(37))
    assert len(long.since) == 32
    assert (long.since[0], long.since[-1]) == (30, 970)
    assert set(np.diff(long.since)) == {30, 40}
    assert list(most.since) == list(range(30, 350, 10))


def test_step_candidates_need_views_of_frame():
    """A step needs three views of its frame on either side, whatever else was observed.

    That of a point has no rotation.
    """
    seen = Made(12, {"sample": np.arange(0, 12, 2)}, {"base": "other"}, point_mounts=frozenset({"base"}))
    (step,) = steps(seen)
    assert (step.since, step.sizes) == ((60,), 3)
    moved = seen.frame_jacobian(0, "base")[..., :3]
    np.testing.assert_array_equal(step.moves[0][:, 0], moved * (np.arange(0, 12, 2) >= 6)[:, None, None])
