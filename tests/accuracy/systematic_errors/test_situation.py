"""What systematic errors know of a solved problem."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.estimation.least_squares.jacobians import by_unknowns
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_packed
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def situation(scenario, seed=0, stamps=None):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    solution = solve_packed(problem, made.cell)
    times = {s.sample: float(s.sample) for s in made.recording.samples} if stamps is None else stamps
    return Situation(problem, solution.state, problem, times)


def test_frames_move_views_as_unknowns_do():
    """Bases and mounts move `camera_from_target` by the same adjoints as the columns of the normal equations."""
    of = situation(Scenario(samples=8))
    (group,) = of.problem.groups
    derivative, columns = by_unknowns(of.problem, group, of.links[0], 6)
    assert len(of.frames) == 3
    for name in of.frames:
        where = np.flatnonzero(np.isin(columns, np.arange(of.problem.width)[of.problem.columns[name]]))
        np.testing.assert_allclose(of.by_frame(0, name), derivative[..., where], atol=1e-12)


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_flanges_move_views_as_their_poses_do(robot):
    """A small tangent of a recorded pose moves the view by what `by_flange` says."""
    of = situation(Scenario(samples=8))
    (group,) = of.problem.groups
    tangent = np.array([1e-6, -2e-6, 3e-6, 2e-6, 1e-6, -1e-6])
    field = "eye_base_from_eye_flange" if robot == "eye" else "hand_base_from_hand_flange"
    moved = replace(group, **{field: getattr(group, field) @ SE3.exp(tangent)})
    before, after = (of.state.camera_from_target(g, of.problem.stops) for g in (group, moved))
    np.testing.assert_allclose((before.inverse() @ after).log(), of.by_flange(0, robot) @ tangent, atol=1e-10)


def test_robots_that_move():
    """A robot that stands still has no errors of its own that could be told."""
    assert situation(Scenario(samples=8, arms="eye_still", camera_mount="fixed")).robots == ("hand",)


def test_times():
    """Seconds where every sample has a stamp, else the order of the samples."""
    of = situation(Scenario(samples=6), stamps={k: 10.0 + 0.5 * k for k in range(6)})
    assert of.timed
    np.testing.assert_allclose(of.times, 10.0 + 0.5 * np.arange(6))
    of = situation(Scenario(samples=6), stamps={0: 1.0})
    assert not of.timed
    np.testing.assert_allclose(of.times, np.arange(6))


def test_no_velocity_off_a_path():
    """Poses one after another in no order have none."""
    assert situation(Scenario(samples=20)).velocity("hand") is None
