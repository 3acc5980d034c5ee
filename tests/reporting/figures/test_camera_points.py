"""Tests of the point residuals per camera."""

from __future__ import annotations

import numpy as np
from tests.seen_points import seen

from basecal.reporting.figures.camera_points import points_by_camera, some_points


def test_camera_points_join_all_targets() -> None:
    """Points of all targets of a camera are joined in their order, separately for each camera."""
    one, two = (seen([[1.0, 2.0]], [[0.1, 0.0]], camera=camera) for camera in ("wrist", "hall"))
    more = seen([[3.0, 4.0], [5.0, 6.0]], np.zeros((2, 2)), [True, False], target="plate")
    joined = points_by_camera([one, two, more])
    assert list(joined) == ["wrist", "hall"]
    assert joined["wrist"].pixels.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert joined["wrist"].used.tolist() == [True, True, False]
    left_out = some_points(joined["wrist"], ~joined["wrist"].used)
    assert (left_out.ids.tolist(), left_out.pixels.tolist(), left_out.camera) == ([1], [[5, 6]], "wrist")
