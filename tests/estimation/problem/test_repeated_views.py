"""Copies of a view are equal in all that it says, and are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CandidateObservation, PixelObservation, PointObservation, PoseObservation
from basecal.estimation.problem.repeated_views import repeated_views, view_content
from basecal.geometry import SE3

IDS, PIXELS = np.array([3, 5]), np.array([[1.5, 2.5], [3.5, 4.5]])
VIEWS = {
    "pixels": (PixelObservation("camera", "board", IDS, PIXELS), {"pixels": PIXELS + 1e-12, "ids": IDS + 1}),
    "candidates": (CandidateObservation("camera", "light", PIXELS), {"pixels": PIXELS[::-1].copy()}),
    "points": (
        PointObservation("camera", "board", IDS, np.ones((2, 3))),
        {"points_in_camera": np.full((2, 3), 1.0 + 1e-12), "ids": IDS + 1},
    ),
    "pose": (
        PoseObservation("camera", "board", SE3.identity()),
        {"camera_from_target": SE3(np.eye(3), np.array([0, 0, 1e-12]))},
    ),
}


@pytest.mark.parametrize("kind", VIEWS)
def test_copies_are_equal_and_nothing_else_is(kind):
    """To the last bit of every number, by camera, target and the stops of both."""
    view, others = VIEWS[kind]
    content = view_content(view, (1, 2))
    assert content == view_content(replace(view), (1, 2))
    assert content != view_content(view, (1, 3))
    assert content != view_content(replace(view, camera="other"), (1, 2))
    assert content != view_content(replace(view, target="other"), (1, 2))
    for field, value in others.items():
        assert content != view_content(replace(view, **{field: value}), (1, 2))


def test_repeated_views_are_listed():
    """All are named, ten are shown; without any nothing is said."""
    assert repeated_views([]) == []
    (one,) = repeated_views([7])
    assert (one.code, one.severity, one.about) == ("duplicate-samples", "info", ("7",))
    assert one.message.startswith("1 view(s) repeat")
    (ten,) = repeated_views(list(range(10)))
    assert "8, 9; look" in ten.message
    (many,) = repeated_views(list(range(11)))
    assert "8, 9, ...; look" in many.message
    assert len(many.about) == 11
