"""Arms whose poses are too long along an axis of their base."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.expected_sizes import size_posterior, with_expected_sizes
from basecal.accuracy.systematic_errors.long_axes import AXES_PRIOR, SHARES, LongAxes, long_axes
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import RobotState
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=40, position_m=0.15, robot_noise=(3e-5, 1e-4), pixel_px=0.1), 3)
CELL = replace(MADE.cell, robots={name: replace(r, is_total_noise=False) for name, r in MADE.cell.robots.items()})
STATED = Settings(robot_noise="stated")


def lengthened(shares):
    """A recording whose robots' true poses are longer than what is recorded, along x of their bases."""

    def recorded(state, share):
        pose = state.base_from_flange
        return RobotState(SE3(pose.rotation, pose.translation / [1 + share, 1, 1]))

    samples = (
        replace(s, robots={name: recorded(state, shares.get(name, 0.0)) for name, state in s.robots.items()})
        for s in MADE.recording.samples
    )
    return replace(MADE.recording, samples=tuple(samples))


def solved(recording, cell=CELL):
    """The situation of a recording, and its solution."""
    solution = solve(cell, recording, STATED)
    problem = solution.noise.hold_sigmas(solution.problem)
    return Situation(problem, solution.state, problem, {}, solution.noise), solution


def test_arms_that_record_poses_alone_have_them():
    """Unless they state all their errors, record joints, or made few stops."""
    situation, _ = solved(MADE.recording)
    assert long_axes(CELL, situation) == [LongAxes("eye"), LongAxes("hand")]
    total = replace(CELL, robots={**CELL.robots, "eye": MADE.cell.robots["eye"]})
    assert long_axes(total, situation) == [LongAxes("hand")]
    few = solved(replace(MADE.recording, samples=MADE.recording.samples[:3]))[0]
    assert long_axes(CELL, few) == []
    by_joints = simulate(Scenario(samples=12, joints=True, robot_noise=(3e-5, 1e-4)), 2)
    assert long_axes(by_joints.cell, solved(by_joints.recording, by_joints.cell)[0]) == []


def test_flanges_move_by_a_share_of_their_place():
    """Along each axis of the base, in the axes of the flange; recorded poses tell it everywhere."""
    pose = MADE.recording.samples[0].robots["hand"].base_from_flange
    poses = SE3(pose.rotation[None], pose.translation[None])
    (tangents,) = LongAxes("hand").flange_tangents(poses)
    np.testing.assert_allclose(pose.rotation @ tangents[:3], np.diag(pose.translation), atol=1e-12)
    assert not tangents[3:].any()
    assert LongAxes("hand").unknown_share(poses) == [0.0]


def test_an_arm_has_none_or_one():
    """None as likely as of two kinds that are both none in one case of two; else along one axis."""
    assert AXES_PRIOR.sigmas.shape == (10, 3)
    np.testing.assert_allclose(AXES_PRIOR.shares.sum(), 1)
    np.testing.assert_allclose(AXES_PRIOR.shares @ (AXES_PRIOR.sigmas == 0).all(1), np.sqrt(0.5))
    assert np.count_nonzero(AXES_PRIOR.sigmas, axis=1).max() == 1
    np.testing.assert_allclose(AXES_PRIOR.shares @ AXES_PRIOR.sigmas**2, (1 - np.sqrt(0.5)) / 3 * np.mean(SHARES**2))


def test_the_data_tell_a_length_of_one_arm():
    """0.3 % along x, within a few of its sigmas; of right arms hardly a sigma of any is left."""
    sizes = []
    for share in (0.0, 3e-3):
        situation, _ = solved(lengthened({"hand": share}))
        known = size_posterior(situation, (), (), long_axes(CELL, situation))
        assert [error.robot for error, _ in known.of_arms] == ["eye", "hand"]
        assert not known.mean.any()
        sizes.append(np.sqrt(np.diag(known.covariance)))
    assert sizes[0].max() < 2e-4
    assert np.argmax(sizes[1]) == 3
    np.testing.assert_allclose(sizes[1][3], 3e-3, rtol=0.2)


@pytest.mark.parametrize("shares", [{"eye": 1e-3, "hand": 1e-3}, {"eye": -5e-4, "hand": -1e-3}, {"hand": 1e-3}])
def test_the_base_of_long_arms_is_within_its_sigmas(shares):
    """Beyond all of them without lengths. Right arms lose a quarter of their sharpness at most."""
    _, solution = solved(lengthened(shares))
    wide = with_expected_sizes(CELL, solution, None)
    assert distance(solution) > 50
    assert distance(wide) < 22.5  # 99.9 % of chi-square with 6 freedoms
    right = solved(MADE.recording)[1]
    after = with_expected_sizes(CELL, right, None)
    name = CELL.requested_transforms[0]
    wider = np.log([np.diag(each.transforms[name].covariance) for each in (after, right)])
    assert 1.0 <= np.exp(0.5 * np.mean(wider[0] - wider[1])) < 1.25


def distance(solution):
    """Squared distance of the base from the truth in its sigmas."""
    name = CELL.requested_transforms[0]
    off = (solution.transforms[name].mean.inverse() @ MADE.truth[name]).log()
    return float(off @ np.linalg.solve(solution.transforms[name].covariance, off))
