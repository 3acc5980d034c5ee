"""Transforms as the page shows them, with what is pasted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, Cell, CellCamera, CellTarget, Robot
from basecal.exchange.exporters.exporter import pasteable
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.transforms import transform_view
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
CELL = simulate(Scenario(samples=2), 0).cell
CALIBRATION = Calibration("good", {BASE: PoseEstimate(SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]), 1e-8 * np.eye(6))})
MOUNT, LIGHT = "eye_flange_from_wrist", "hand_flange_from_led"
SIGMA = np.array([3e-4, 4e-4, 0.0, 3e-3, 0.0, 4e-3])
BARE_CELL = Cell(
    "eye",
    {name: Robot(name) for name in ("eye", "hand")},
    cameras={"wrist": CellCamera("wrist", "eye")},
    targets={"led": CellTarget("led", "hand")},
)
BARE = Calibration(
    "good",
    transforms={
        BASE: PoseEstimate(SE3.from_rpy([0, 0, np.pi / 2], [1.25, -0.5, 0.0]), np.diag(SIGMA**2)),
        MOUNT: PoseEstimate(SE3.identity(), np.zeros((6, 6))),
        LIGHT: PoseEstimate(SE3(np.eye(3), np.array([0, 0, 0.1])), np.diag([1e-6, 1e-6, 1e-6, 0, 0, 0])),
    },
    status={BASE: "free", MOUNT: "fixed"},
    points=frozenset({LIGHT}),
)


def test_every_kind_is_offered_both_ways():
    """What `export` writes, word for word, of the transform and of its inverse."""
    pasted = pasteable(CALIBRATION, CELL, "run")
    view = transform_view(BASE, CELL, CALIBRATION, pasted)
    offered = {(copy.way, copy.kind): copy.text for copy in view.copies}
    for way in (BASE, "hand_base_from_eye_base"):
        for kind, text in pasted[way].items():
            assert offered[way, kind] == text.strip("\n")
    assert offered[BASE, "urdf"].startswith("<origin")
    assert {"ur", "kuka", "abb", "ros", "matrix"} <= {copy.kind for copy in view.copies}


def test_a_point_is_not_pasted():
    """Its rotation is not defined."""
    point = Calibration("good", CALIBRATION.transforms, points=frozenset({BASE}))
    view = transform_view(BASE, CELL, point, {BASE: {"ur": "p[0]"}})
    assert view.copies == []
    assert view.quaternion == ""


def test_numbers_are_in_mm_and_deg_with_their_sigmas():
    """Each along x, y and z, with two digits of the smallest sigma."""
    view = transform_view(BASE, BARE_CELL, BARE, {})
    assert view.status == "free"
    translation, rotation = view.rows
    assert [float(v) for v in translation.values] == [1250, -500, 0]
    assert [float(v) for v in translation.sigmas] == pytest.approx([0.3, 0.4, 0])
    assert [float(v) for v in rotation.values] == pytest.approx([0, 0, 90])
    assert [float(v) for v in rotation.sigmas] == pytest.approx(np.degrees(SIGMA[3:]), abs=5e-3)
    assert (translation.unit, rotation.unit) == ("mm", "deg")


def test_the_quaternion_has_its_scalar_last():
    """A quarter turn about z."""
    view = transform_view(BASE, BARE_CELL, BARE, {})
    assert [float(v) for v in view.quaternion.split()] == pytest.approx([0, 0, np.sqrt(0.5), np.sqrt(0.5)])


def test_what_is_fixed_has_no_sigmas():
    """Its numbers alone; what has no status is free."""
    fixed = transform_view(MOUNT, BARE_CELL, BARE, {})
    assert fixed.status == "fixed"
    assert not any(row.sigmas for row in fixed.rows)
    assert fixed.figure is None
    assert transform_view(BASE, BARE_CELL, replace(BARE, status={}), {}).status == "free"


def test_a_point_has_no_rotation():
    """Nor forms for other programs, whose transforms turn."""
    view = transform_view(LIGHT, BARE_CELL, BARE, {})
    assert view.status == "free, a point"
    assert [row.name for row in view.rows] == ["t"]
    assert view.quaternion == ""
    assert view.copies == []
