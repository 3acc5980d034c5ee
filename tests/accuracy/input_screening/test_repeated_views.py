"""Tests of the finding `repeated-view`: equal views with different robot poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.input_screening.repeated_views import repeated_views
from basecal.cell import RobotState
from basecal.simulation import Scenario, simulate


def copy_views(made, *pairs):
    samples = list(made.recording.samples)
    for one, other in pairs:
        samples[other] = replace(samples[other], observations=samples[one].observations)
    return replace(made.recording, samples=tuple(samples))


@pytest.mark.parametrize("target", ["charuco", "pose", "points3d"])
def test_equal_views_with_other_poses_are_reported(target):
    """Each pair of equal views with other poses is reported; a correct recording has none."""
    made = simulate(Scenario(samples=8, target=target), 0)
    assert repeated_views(made.cell, made.recording) == []
    (found,) = repeated_views(made.cell, copy_views(made, (1, 4), (2, 7)))
    assert (found.code, found.severity, found.about) == ("repeated-view", "warning", ("1", "4", "2", "7"))
    assert "at samples 1 and 4, samples 2 and 7. Pair poses and images again" in found.message


def test_five_pairs_are_listed():
    """Five pairs are listed, and the others are counted."""
    made = simulate(Scenario(samples=16), 0)
    (found,) = repeated_views(made.cell, copy_views(made, *((k, k + 8) for k in range(8))))
    assert "and 3 more pairs" in found.message


def test_views_without_relevant_motion_are_ignored():
    """Copies of whole rows, motion of an uninvolved robot, and LEDs are ignored.

    The two numbers of an LED may be equal by chance.
    """
    made = simulate(Scenario(samples=6), 0)
    rows = list(made.recording.samples)
    rows[4] = replace(rows[1], sample=4)
    assert repeated_views(made.cell, replace(made.recording, samples=tuple(rows))) == []
    alone = simulate(Scenario(samples=6, layout="eye_in_hand"), 0)
    idle = {**alone.cell.robots, "idle": replace(next(iter(alone.cell.robots.values())), name="idle")}
    rows = [
        replace(row, robots={"arm": alone.recording.samples[0].robots["arm"], "idle": row.robots["arm"]})
        for row in copy_views(alone, (1, 4)).samples
    ]
    moved = replace(alone.recording, samples=tuple(rows))
    assert repeated_views(replace(alone.cell, robots=idle), moved) == []
    light = simulate(Scenario(samples=6, target="led"), 0)
    assert repeated_views(light.cell, copy_views(light, (1, 4))) == []


def test_joints_determine_robot_pose():
    """Equal views with two joint postures are reported; postures that differ only by read-back are not."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    (found,) = repeated_views(made.cell, copy_views(made, (1, 4)))
    assert found.about == ("1", "4")
    first = made.recording.samples[1].robots
    for off, is_reported in ((4e-3, False), (6e-3, True)):
        rows = list(copy_views(made, (1, 4)).samples)
        again = {name: RobotState(joints_rad=of.joints_rad + off * np.eye(6)[2]) for name, of in first.items()}
        rows[4] = replace(rows[4], robots=again)
        assert bool(repeated_views(made.cell, replace(made.recording, samples=tuple(rows)))) == is_reported


def test_robot_recorded_differently_has_other_pose():
    """A robot recorded once by pose and once by joints counts as elsewhere."""
    made = simulate(Scenario(samples=6), 0)
    rows = list(copy_views(made, (1, 4)).samples)
    rows[4] = replace(rows[4], robots={**rows[1].robots, "hand": RobotState(joints_rad=np.zeros(6))})
    (found,) = repeated_views(made.cell, replace(made.recording, samples=tuple(rows)))
    assert found.about == ("1", "4")
    missing = replace(rows[4], robots={"eye": rows[1].robots["eye"]})
    assert repeated_views(made.cell, replace(made.recording, samples=(*rows[:4], missing, rows[5]))) == []


@pytest.mark.parametrize(("points", "is_reported"), [(3, False), (4, True)])
def test_four_equal_points_are_no_chance(points, is_reported):
    """Four equal image points (eight numbers) are no chance; with other point ids it is another view."""
    made = simulate(Scenario(samples=6), 0)
    rows = []
    for row in copy_views(made, (1, 4)).samples:
        (seen,) = row.observations
        rows.append(replace(row, observations=(replace(seen, ids=seen.ids[:points], pixels=seen.pixels[:points]),)))
    assert bool(repeated_views(made.cell, replace(made.recording, samples=tuple(rows)))) == is_reported
    (seen,) = rows[4].observations
    rows[4] = replace(rows[4], observations=(replace(seen, ids=seen.ids + 1),))
    assert repeated_views(made.cell, replace(made.recording, samples=tuple(rows))) == []


def test_five_pairs_have_full_message():
    """Exactly five pairs are all listed in the message."""
    made = simulate(Scenario(samples=12), 0)
    (found,) = repeated_views(made.cell, copy_views(made, *((k, k + 6) for k in range(5))))
    assert found.message == (
        "The same image or view occurs twice with different robot poses, at samples 0 and 6, samples 1 and 7, "
        "samples 2 and 8, samples 3 and 9, samples 4 and 10. Pair poses and images again, or remove the copies."
    )
    assert found.about == ("0", "6", "1", "7", "2", "8", "3", "9", "4", "10")
