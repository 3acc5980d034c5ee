"""Tests of scene views in a problem."""

from __future__ import annotations

from basecal.estimation.problem.tied_views import SCENE
from tied_scene import tracks_alone


def test_stops_of_a_scene_are_shared() -> None:
    """Each view connects its stop to all others. Robots and their ends are known, and nothing carries the scene."""
    _, _, problem, _ = tracks_alone(1, count=4)
    assert problem.tied is not None
    assert problem.tied.stops.tolist() == list(range(8))
    assert problem.shared_stops.tolist() == list(range(8))
    assert problem.robots == ("left", "right")
    assert [end.mount for end in problem.robot_ends("right")] == ["right_flange_from_right_eye"]
    assert problem.robot_ends(None) == []
    assert {group.target for group in problem.all_groups} == {SCENE}
