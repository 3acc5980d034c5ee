"""A scene found from its pictures."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.scene import find_scene as room
from basecal.accuracy.scene.find_scene import Report, find_scene
from basecal.estimation.settings import Settings
from scene_pictures import pictures_of_scene, solved_camera
from scene_points import BASE, made_scene


def test_two_cameras_are_joined_into_one_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """The base is found to 3 mm, nothing is reported, and most points are seen by both."""
    scene = made_scene(1, arms=2, count=12, points=220)
    pictures, report = pictures_of_scene(scene), Report()
    monkeypatch.setattr(room, "solve_camera", lambda pictures, camera, _: solved_camera(scene, pictures, camera))
    fit = find_scene(pictures, (None, None), "left", report, Settings())
    assert fit is not None
    assert report.findings == []
    assert np.linalg.norm((BASE.inverse() @ fit.state.bases[1]).translation) < 3e-3
    assert fit.tracks.count > 180
