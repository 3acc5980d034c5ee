"""Directions that a target was seen from."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.fit_details import ViewPoses
from basecal.geometry import SE3
from basecal.reporting.figures.orientations import orientation_figure


def views(*tilts_deg, front=1.0):
    """Half a metre off, tilted about y."""
    angles = np.radians(tilts_deg)
    away = np.stack([np.sin(angles), 0 * angles, front * np.cos(angles)], -1)
    turn = np.stack([0 * angles, angles, 0 * angles], -1)
    target_from_camera = SE3.from_rotvec(turn, 0.5 * away)
    return ViewPoses("wrist", "board", np.arange(len(tilts_deg)), target_from_camera.inverse())


@pytest.mark.parametrize("front", [1.0, -1.0])
def test_tilts_are_told_whichever_side_is_the_face(front):
    """Straight on is the middle, 25 degrees is inside the ring of 30."""
    figure = orientation_figure(views(0, 10, 25, front=front))
    assert "Tilts of 0° to 25°" in figure.caption
    assert "sample 2: tilted by 25 deg" in figure.svg
    assert ">30°<" in figure.svg
    assert figure.svg.count('class="mark view"') == 3


def test_what_is_seen_all_round_has_rings_to_the_back():
    """Up to 180 degrees."""
    assert ">180°<" in orientation_figure(views(0, 20, 170)).svg


def test_many_views_are_thinned():
    """At most 400 marks."""
    assert orientation_figure(views(*np.linspace(0, 20, 1000))).svg.count('class="mark view"') <= 400
