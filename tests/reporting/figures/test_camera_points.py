"""Residuals of points put together."""

from __future__ import annotations

import numpy as np
from tests.seen_points import seen

from basecal.reporting.figures.camera_points import points_by_camera, some_points


def test_points_of_a_camera_are_those_of_all_its_targets() -> None:
    """In their order; another camera has its own."""
    one, two = (seen([[1.0, 2.0]], [[0.1, 0.0]], camera=camera) for camera in ("wrist", "hall"))
    more = seen([[3.0, 4.0], [5.0, 6.0]], np.zeros((2, 2)), [True, False], target="plate")
    joined = points_by_camera([one, two, more])
    assert list(joined) == ["wrist", "hall"]
    assert joined["wrist"].pixels.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert joined["wrist"].used.tolist() == [True, True, False]
    left_out = some_points(joined["wrist"], ~joined["wrist"].used)
    assert (left_out.ids.tolist(), left_out.pixels.tolist(), left_out.camera) == ([1], [[5, 6]], "wrist")
