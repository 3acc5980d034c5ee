"""Errors of arms that record poses alone, where they are sent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.expected_sizes import with_expected_sizes
from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.meeting import make_meeting
from basecal.accuracy.task.meeting_errors import meeting_errors
from basecal.accuracy.task.pose_errors import POSE_EFFECTS, moved_by_pose_errors, unseen_share
from basecal.cell import Recording, RobotState
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.random_effects import shared_errors
from basecal.estimation.noise.robot_noise import stands
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
ARMS = Scenario(samples=20, robot_noise=(3e-5, 5e-5), state_robot_noise=False, state_pixel_noise=False)


def wrong_by_place(made, size):
    """The recording with poses of the hand shifted smoothly by some size [m], and the true poses."""
    weights, samples = size * np.random.default_rng(0).standard_normal((3, 3)), []
    for sample in made.recording.samples:
        pose = sample.robots["hand"].base_from_flange
        shifted = SE3(pose.rotation, pose.translation + weights @ np.sin(4 * pose.translation))
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(shifted)}))
    return Recording(tuple(samples))


@pytest.fixture(scope="module")
def solved():
    made = simulate(ARMS, 1)
    return made, solve(made.cell, wrong_by_place(made, 1e-3), Settings(robot_noise="estimated"))


@pytest.mark.parametrize("name", POSE_EFFECTS)
def test_at_recorded_poses_they_are_those_of_stops(solved, name):
    """In the axes of the base, to what the modes left out explain; three metres away no recorded pose says anything."""
    problem = solved[1].problem
    poses, seen = stands(problem, "hand")
    at_stops = shared_errors(RANDOM_EFFECTS[name], problem, "hand").by_stop[seen]
    places = poses[np.flatnonzero(seen)].translation
    found = moved_by_pose_errors(problem, "hand", places, name)
    np.testing.assert_allclose(found, np.kron(np.eye(2), poses.rotation[seen]) @ at_stops, atol=1e-12)
    assert unseen_share(problem, "hand", places, name).max() < 0.08
    assert unseen_share(problem, "hand", places + np.array([0, 0, 3.0]), name).min() > 0.99


def test_what_the_base_takes_up_counts_once(solved):
    """At recorded places the miss is better known than base and errors alone, and 95 in 100 are within three sigmas."""
    made, solution = solved
    poses = made.true_base_from_flange["hand"]
    places = solution.state.transforms[BASE] @ poses.translation
    meeting = make_meeting(made.cell, solution.problem, solution.state, BASE, places)
    widening = with_expected_sizes(made.cell, solution, None).covariance - solution.covariance
    mean, covariance = meeting_errors(meeting, ArmErrors(made.cell, solution, solution), {"robots": {}}, widening)
    alone = meeting.total_error(solution.covariance + widening, ())
    (name,) = solution.noise.common
    assert "hand" in solution.noise.common[name]
    assert np.trace(covariance.mean(0)[:3, :3]) < 0.7 * np.trace(alone.mean(0)[:3, :3])
    meant = np.array([s.robots["hand"].base_from_flange.translation for s in wrong_by_place(made, 1e-3).samples])
    missed = solution.state.transforms[BASE].inverse() @ (made.truth[BASE] @ poses.translation) - meant
    off = missed - mean[:, :3]
    distance = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance[:, :3, :3]), off)
    assert np.all(np.linalg.eigvalsh(covariance)[:, 0] > 0)
    assert np.mean(distance < 9) > 0.9
