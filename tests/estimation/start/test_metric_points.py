"""Tests of a start from points measured in space."""

from __future__ import annotations

import numpy as np
from tests.touch_cells import BASE, MARKS, TIPS, TRUTH, recorded, touch_cell, touch_lines

from basecal.cell import PointObservation, Recording, RobotState, Sample
from basecal.cell.files import cell_from_dict
from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.first_state import first_state
from basecal.geometry import SE3

FREE = {"status": "free"}
TRACKER_CELL = {
    "schema": "basecal/cell/1",
    "reference": "arm",
    "robots": {"arm": {}},
    "cameras": {"tracker": {"on": "world", "mount": FREE}},
    "targets": {"ball": {"on": "arm", "kind": "points", "points_m": [[0, 0, 0]], "mount": FREE}},
}


def test_tracker_with_one_reflector_is_started():
    """A tracker in the world starts within 0.3 rad of its pose, though no view has a pose."""
    rng, cell = np.random.default_rng(1), cell_from_dict(TRACKER_CELL)
    tracker, reflector = SE3.from_rpy((0.3, -0.2, 1.0), (3.0, 1.0, 0.5)), np.array([0.05, 0.0, 0.1])
    poses = SE3.from_rotvec(rng.normal(0, 0.7, (15, 3)), np.array([0.4, 0.0, 0.5]) + rng.uniform(-0.5, 0.5, (15, 3)))
    points = tracker.inverse() @ (poses @ np.broadcast_to(reflector, (15, 3)))
    samples = (
        Sample(
            k, None, {"arm": RobotState(poses[k])}, (PointObservation("tracker", "ball", np.array([0]), points[[k]]),)
        )
        for k in range(15)
    )
    problem, _ = build_problem(cell, Recording(tuple(samples)))
    found = first_state(problem, cell, thorough=False).transforms["arm_base_from_tracker"]
    assert np.linalg.norm((found.inverse() @ tracker).rotvec) < 0.3


def test_marks_and_tips_of_unknown_position_are_started():
    """Exact touches of three marks give the base, tips and marks together. A small prior keeps them near."""
    cell = touch_cell()
    problem, _ = build_problem(cell, recorded(cell, touch_lines(np.random.default_rng(0), 30, 0.0)))
    found = first_state(problem, cell, thorough=False).transforms
    assert np.abs((found[BASE].inverse() @ TRUTH).log()).max() < 1e-4
    for robot, tip in TIPS.items():
        np.testing.assert_allclose(found[f"{robot}_flange_from_{robot}_tip"].translation, tip, atol=1e-4)
    for name, mark in MARKS.items():
        np.testing.assert_allclose(found[f"eye_base_from_{name}"].translation, mark, atol=1e-4)


def test_tip_to_tip_contacts_start_near_the_truth():
    """Tips of unknown length that touch each other start within 0.3 rad."""
    cell = touch_cell(())
    problem, _ = build_problem(cell, recorded(cell, touch_lines(np.random.default_rng(0), 30, 0.0, {})))
    found = first_state(problem, cell, thorough=False).transforms
    assert np.linalg.norm((found[BASE].inverse() @ TRUTH).rotvec) < 0.3
