"""Transforms as the page shows them, with what is pasted."""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration
from basecal.exchange.exporters.exporter import pasteable
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.transforms import transform_view
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
CELL = simulate(Scenario(samples=2), 0).cell
CALIBRATION = Calibration("good", {BASE: PoseEstimate(SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]), 1e-8 * np.eye(6))})


def test_every_kind_is_offered_both_ways():
    """What `export` writes, word for word, of the transform and of its inverse."""
    pasted = pasteable(CALIBRATION, CELL, "run")
    view = transform_view(BASE, CELL, CALIBRATION, pasted)
    assert view.ways == (BASE, "hand_base_from_eye_base")
    offered = {(copy.way, copy.kind): copy.text for copy in view.copies}
    for way in view.ways:
        for kind, text in pasted[way].items():
            assert offered[way, kind] == text.strip("\n")
    assert offered[BASE, "urdf"].startswith("<origin")
    assert {"ur", "kuka", "abb", "ros", "matrix"} <= {copy.kind for copy in view.copies}


def test_a_point_is_not_pasted():
    """Its rotation is not defined."""
    point = Calibration("good", CALIBRATION.transforms, points=frozenset({BASE}))
    view = transform_view(BASE, CELL, point, {BASE: {"ur": "p[0]"}})
    assert view.copies == ()
    assert view.quaternion == ()
