"""Tests of the benchmark of peers: each method gets a task that it can solve, and all are counted equally."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from benchmarks.peers import tables
from benchmarks.peers.task import Design, DesignName, make_task
from benchmarks.peers.trial import trial

# 5e-4 px and robots without error leave 0.02 mm to the worst of the methods (LI, 6 to 30 mm at 0.2 to 0.5 px); a
# transform read the wrong way round leaves decimetres.
NEARLY_NOTHING_PX = 5e-4
NEAR_MM = 1.0


@pytest.mark.parametrize("name", ["halves", "hand-eye", "both"])
def test_every_method_finds_the_truth_in_perfect_data(name: DesignName) -> None:
    """With nearly no noise each method finds the true transform: no method fails because of a convention."""
    found = trial(Design(name, 20, NEARLY_NOTHING_PX, (0.0, 0.0)), seed=1)
    assert len(found.errors) == {"halves": 14, "hand-eye": 7, "both": 0}[name] + 5
    assert {method: error for method, error in found.errors.items() if not error.mm < NEAR_MM} == {}


def test_pose_sigmas_agree_with_pose_errors() -> None:
    """Pose errors of `solvePnP` over their sigmas have unit variance.

    40 poses of six values: the mean square of 240 values, correlated within a pose, at least 40 independent ones, has a
    standard error of at most sqrt(2 / 40) = 0.22; five of them to either side.
    """
    task = make_task(Design("hand-eye", 40, 0.2, (0.0, 0.0)), seed=3)
    flange_from_camera, base_from_target = task.truth
    true = (task.eye_base_from_eye_flange @ flange_from_camera).inverse() @ base_from_target
    ratio = (task.camera_from_target.inverse() @ true).log() / task.sigma
    assert abs(np.mean(ratio**2) - 1) < 5 * 0.22


def _row(opencv_mm: float, ours_mm: float) -> dict[str, Any]:
    def at(mm: float) -> dict[str, float]:
        return {"rms_mm": mm, "rms_mrad": mm, "median_mm": mm, "median_mrad": mm, "median_ms": 1.0, "failed": 0}

    methods = {"OpenCV TSAI": at(9.0), "OpenCV PARK": at(opencv_mm), tables.SCIPY: at(8.0)} | {
        m: at(ours_mm) for m in tables.OURS
    }
    where = {"design": "hand-eye", "samples": 15, "pixel_px": 0.2, "robot_mm_mrad": [0.0, 0.0]}
    return {**where, "methods": methods, "predicted": {"rms_mm": 1.0, "rms_mrad": 1.0}, "pnp_ms": 1.0}


def test_missed_rows_are_listed() -> None:
    """A row is missed if a peer is nearer, or if the best result of OpenCV is less than three times as far."""
    assert tables.missed_goals([_row(opencv_mm=7.0, ours_mm=2.0)]) == []
    (short,) = tables.missed_goals([_row(opencv_mm=5.0, ours_mm=2.0)])
    assert "only 2.50 times ours" in short
    assert len(tables.missed_goals([_row(opencv_mm=5.0, ours_mm=6.0)])) == 9
