"""Tests of error fields and axis lengths of robots that record only poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors import pose_fields
from basecal.accuracy.systematic_errors.expected_sizes import size_posterior, with_expected_sizes
from basecal.accuracy.systematic_errors.pose_fields import (
    FIELD_PRIOR_M,
    LENGTH_SHARES,
    LENGTHS_PRIOR,
    AxisLengths,
    axis_lengths,
    pose_field,
    stated_fields,
    variances,
)
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import RobotState
from basecal.estimation.noise.random_effects import FEWEST_STOPS
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=24, position_m=0.15, robot_noise=(3e-5, 1e-4)), 2)
STATED = Settings(robot_noise="stated")


def with_kind(cell, is_total):
    """The cell whose robots state noise of a kind."""
    robots = {name: replace(robot, is_total_noise=is_total) for name, robot in cell.robots.items()}
    return replace(cell, robots=robots)


def stretch_poses(share):
    """A recording whose hand poses are too long along x of its base by a share."""

    def recorded(pose):
        return RobotState(SE3(pose.rotation, pose.translation * [1 + share, 1, 1]))

    samples = tuple(
        replace(s, robots={**s.robots, "hand": recorded(s.robots["hand"].base_from_flange)})
        for s in MADE.recording.samples
    )
    return replace(MADE.recording, samples=samples)


def situate_recording(recording):
    """The situation of a recording, and its solution."""
    solution = solve(MADE.cell, recording, STATED)
    problem = solution.noise.hold_sigmas(solution.problem)
    return Situation(problem, solution.state, problem, {}, solution.noise), solution


@pytest.mark.parametrize(("is_total", "robots"), [(False, ["eye", "hand"]), (True, [])])
def test_repeatability_leaves_accuracy_unknown(is_total, robots):
    """Robots that state repeatability have a field; those that state their total noise have none."""
    situation, _ = situate_recording(MADE.recording)
    assert [field.robot for field in stated_fields(with_kind(MADE.cell, is_total), situation)] == robots


def test_joint_robots_have_no_field():
    """Robots that record joints have no field: their joints and links err."""
    made = simulate(Scenario(samples=12, joints=True, robot_noise=(3e-5, 1e-4)), 2)
    solution = solve(made.cell, made.recording, STATED)
    situation = Situation(solution.problem, solution.state, solution.problem, {}, solution.noise)
    assert pose_field(situation, "eye") is None


def test_shared_stop_errors_replace_field(monkeypatch):
    """A robot with shared stop errors in the random effects has no field, nor one with few stops."""
    situation, _ = situate_recording(MADE.recording)
    common = {"smooth": {"hand": np.array([1e-4, 2e-4])}}
    beside = replace(situation, noise=replace(situation.noise, common=common))
    assert pose_field(beside, "hand") is None
    assert pose_field(beside, "eye").robot == "eye"
    for count, is_none in ((FEWEST_STOPS - 1, True), (FEWEST_STOPS, False)):
        monkeypatch.setattr(pose_fields, "count_stops", lambda problem, robot, count=count: count)
        assert (pose_field(situation, "hand") is None) == is_none


def test_field_prior_has_typical_robot_sigmas():
    """A field is absent as often as two kinds are both absent in one case of two.

    Else its sigma is from 0.1 mm to 2 mm of length.
    """
    np.testing.assert_allclose(FIELD_PRIOR_M.probabilities, [np.sqrt(0.5), *[(1 - np.sqrt(0.5)) / 3] * 3])
    lengths = np.sqrt(3) * FIELD_PRIOR_M.sigmas
    assert lengths[0] == 0
    assert 9e-5 < lengths[1] < lengths[2] < lengths[3] < 2e-3


def test_field_variance_is_full_far_away():
    """The unknown share of a field is small at recorded poses, and full at two metres from all of them."""
    situation, _ = situate_recording(MADE.recording)
    field = pose_field(situation, "hand")
    poses = situation.recorded_pose(0, "hand")
    far = SE3(poses.rotation, poses.translation + np.array([2.0, 0.0, 0.0]))
    assert field.unknown_share(poses).max() < 0.1
    assert field.unknown_share(far).min() > 0.95
    assert field.flange_tangents(poses).shape == (24, 6, field.width)
    np.testing.assert_allclose(variances(4e-8), [4e-8, 1.6e-7])


def test_data_determine_field_size():
    """The data show a small field of a correct robot.

    A robot half a percent long along an axis has the expected size.
    """
    sizes = []
    for share in (0.0, 5e-3):
        situation, _ = situate_recording(stretch_poses(share))
        sizes.append(size_posterior(situation, [pose_field(situation, "hand")]).field_m2)
    assert np.sqrt(sizes[0]) < 2e-4
    assert np.sqrt(sizes[1]) > 4e-4
    assert np.sqrt(sizes[1]) <= FIELD_PRIOR_M.sigmas.max()


@pytest.mark.journey
def test_answer_covariance_grows_with_robot_error():
    """Fields widen the answer of correct robots by a fifth at most, of a long one by several times."""
    ratios = []
    for share in (0.0, 5e-3):
        _, solution = situate_recording(stretch_poses(share))
        wide, plain = (with_expected_sizes(with_kind(MADE.cell, total), solution, None) for total in (False, True))
        name = MADE.cell.requested_transforms[0]
        ratio = np.diag(wide.transforms[name].covariance) / np.diag(plain.transforms[name].covariance)
        ratios.append(float(np.exp(0.5 * np.log(ratio).mean())))
    assert 1 <= ratios[0] < 1.2
    assert ratios[1] > 1.5


LONG_MADE = simulate(Scenario(samples=40, position_m=0.15, robot_noise=(3e-5, 1e-4), pixel_px=0.1), 3)
CELL = replace(
    LONG_MADE.cell, robots={name: replace(r, is_total_noise=False) for name, r in LONG_MADE.cell.robots.items()}
)


def lengthen_poses(shares):
    """A recording whose robots' true poses are longer than recorded, along x of their bases."""

    def recorded(state, share):
        pose = state.base_from_flange
        return RobotState(SE3(pose.rotation, pose.translation / [1 + share, 1, 1]))

    samples = (
        replace(s, robots={name: recorded(state, shares.get(name, 0.0)) for name, state in s.robots.items()})
        for s in LONG_MADE.recording.samples
    )
    return replace(LONG_MADE.recording, samples=tuple(samples))


def solve_recording(recording, cell=CELL):
    """The situation of a recording, and its solution."""
    solution = solve(cell, recording, STATED)
    problem = solution.noise.hold_sigmas(solution.problem)
    return Situation(problem, solution.state, problem, {}, solution.noise), solution


@pytest.mark.journey
def test_pose_robots_have_axis_lengths():
    """Robots that record only poses have axis lengths unless they state all their errors or made few stops.

    Robots that record joints have none.
    """
    situation, _ = solve_recording(LONG_MADE.recording)
    assert axis_lengths(CELL, situation) == [AxisLengths("eye"), AxisLengths("hand")]
    total = replace(CELL, robots={**CELL.robots, "eye": LONG_MADE.cell.robots["eye"]})
    assert axis_lengths(total, situation) == [AxisLengths("hand")]
    few = solve_recording(replace(LONG_MADE.recording, samples=LONG_MADE.recording.samples[:3]))[0]
    assert axis_lengths(CELL, few) == []
    by_joints = simulate(Scenario(samples=12, joints=True, robot_noise=(3e-5, 1e-4)), 2)
    assert axis_lengths(by_joints.cell, solve_recording(by_joints.recording, by_joints.cell)[0]) == []


def test_axis_length_moves_flange_proportionally():
    """Flanges move by a share of their position along each axis of the base, in flange axes.

    Recorded poses determine it everywhere.
    """
    pose = LONG_MADE.recording.samples[0].robots["hand"].base_from_flange
    poses = SE3(pose.rotation[None], pose.translation[None])
    (tangents,) = AxisLengths("hand").flange_tangents(poses)
    np.testing.assert_allclose(pose.rotation @ tangents[:3], np.diag(pose.translation), atol=1e-12)
    assert not tangents[3:].any()
    assert AxisLengths("hand").unknown_share(poses) == [0.0]


def test_axis_length_prior_has_none_or_one_axis():
    """An axis length is absent as often as two kinds are both absent in one case of two. Else it is along one axis."""
    assert LENGTHS_PRIOR.sigmas.shape == (10, 3)
    np.testing.assert_allclose(LENGTHS_PRIOR.probabilities.sum(), 1)
    np.testing.assert_allclose(LENGTHS_PRIOR.probabilities @ (LENGTHS_PRIOR.sigmas == 0).all(1), np.sqrt(0.5))
    assert np.count_nonzero(LENGTHS_PRIOR.sigmas, axis=1).max() == 1
    np.testing.assert_allclose(
        LENGTHS_PRIOR.probabilities @ LENGTHS_PRIOR.sigmas**2, (1 - np.sqrt(0.5)) / 3 * np.mean(LENGTH_SHARES**2)
    )


def test_data_determine_axis_length_of_one_arm():
    """A length error of 0.3 % along x is found within a few sigmas; correct robots have hardly any sigma left."""
    sizes = []
    for share in (0.0, 3e-3):
        situation, _ = solve_recording(lengthen_poses({"hand": share}))
        known = size_posterior(situation, (), (), axis_lengths(CELL, situation))
        assert [error.robot for error, _ in known.of_arms] == ["eye", "hand"]
        assert not known.mean.any()
        sizes.append(np.sqrt(np.diag(known.covariance)))
    assert sizes[0].max() < 2e-4
    assert np.argmax(sizes[1]) == 3
    np.testing.assert_allclose(sizes[1][3], 3e-3, rtol=0.2)


@pytest.mark.journey
@pytest.mark.parametrize("shares", [{"eye": 1e-3, "hand": 1e-3}, {"eye": -5e-4, "hand": -1e-3}, {"hand": 1e-3}])
def test_base_of_long_arms_is_within_sigmas(shares):
    """The base of long arms is within its sigmas, and far beyond without axis lengths.

    Correct robots lose a quarter of their precision at most.
    """
    _, solution = solve_recording(lengthen_poses(shares))
    wide = with_expected_sizes(CELL, solution, None)
    assert distance(solution) > 50
    assert distance(wide) < 22.5  # 99.9 % of chi-square with 6 freedoms
    right = solve_recording(LONG_MADE.recording)[1]
    after = with_expected_sizes(CELL, right, None)
    name = CELL.requested_transforms[0]
    wider = np.log([np.diag(each.transforms[name].covariance) for each in (after, right)])
    assert 1.0 <= np.exp(0.5 * np.mean(wider[0] - wider[1])) < 1.25


def distance(solution):
    """Squared distance of the base from the truth in its sigmas."""
    name = CELL.requested_transforms[0]
    off = (solution.transforms[name].mean.inverse() @ LONG_MADE.truth[name]).log()
    return float(off @ np.linalg.solve(solution.transforms[name].covariance, off))
