"""Tests of transforms on the page, with their snippets to copy."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, Cell, CellCamera, CellTarget, Recording, Robot
from basecal.exchange.exporters.exporter import pasteable
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.page import page
from basecal.reporting.text import status_words, transform_rows
from basecal.reporting.transforms import copies
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


def test_all_formats_are_offered_in_both_directions():
    """The page offers the exact text that `export` writes, for the transform and for its inverse."""
    pasted = pasteable(CALIBRATION, CELL, "run")
    found = copies(BASE, CELL, CALIBRATION, pasted)
    offered = {(copy.transform, copy.kind): copy.text for copy in found}
    for way in (BASE, "hand_base_from_eye_base"):
        for kind, text in pasted[way].items():
            assert offered[way, kind] == text.strip("\n")
    assert offered[BASE, "urdf"].startswith("<origin")
    assert {"ur", "kuka", "abb", "ros", "matrix"} <= {copy.kind for copy in found}


def test_point_has_no_snippets():
    """A point has no snippets, because its rotation is undefined."""
    point = Calibration("good", CALIBRATION.transforms, points=frozenset({BASE}))
    assert copies(BASE, CELL, point, {BASE: {"ur": "p[0]"}}) == []


def test_transform_rows_are_in_mm_and_deg():
    """Values and sigmas along x, y and z are in mm and deg, with two digits of the smallest sigma."""
    assert status_words(BASE, BARE) == "free"
    translation, rotation = transform_rows(BASE, BARE)
    assert [float(v) for v in translation.values] == [1250, -500, 0]
    assert [float(v) for v in translation.sigmas] == pytest.approx([0.3, 0.4, 0])
    assert [float(v) for v in rotation.values] == pytest.approx([0, 0, 90])
    assert [float(v) for v in rotation.sigmas] == pytest.approx(np.degrees(SIGMA[3:]), abs=5e-3)
    assert (translation.unit, rotation.unit) == ("mm", "deg")


def test_quaternion_has_scalar_last():
    """The quaternion on the page is in the order x, y, z, w, shown by a rotation of 90 deg about z."""
    first = re.findall("q_xyzw ([^<]*)<", page(BARE_CELL, Recording(), BARE))[0]
    assert [float(v) for v in first.split()] == pytest.approx([0, 0, np.sqrt(0.5), np.sqrt(0.5)])


def test_fixed_transform_has_no_sigmas():
    """A fixed transform has its numbers alone; a transform without status is free."""
    assert status_words(MOUNT, BARE) == "fixed"
    assert not any(row.sigmas for row in transform_rows(MOUNT, BARE))
    assert status_words(BASE, replace(BARE, status={})) == "free"


def test_a_point_has_no_rotation():
    """A point has no rotation and no snippets for other programs. A fixed point has no sigma."""
    assert status_words(LIGHT, BARE) == "free, a point"
    assert [row.name for row in transform_rows(LIGHT, BARE)] == ["t"]
    assert copies(LIGHT, BARE_CELL, BARE, {}) == []
    html = page(BARE_CELL, Recording(), BARE)
    assert "t in hand_flange; ± 1 sigma per axis of led." in html
    fixed = page(BARE_CELL, Recording(), replace(BARE, status={LIGHT: "fixed"}))
    assert "t in hand_flange." in fixed
