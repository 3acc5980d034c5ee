"""Fields of errors of arms that record poses alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.expected_sizes import size_posterior, with_expected_sizes
from basecal.accuracy.systematic_errors.pose_fields import PRIOR_M, pose_field, stated_fields, variances
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import RobotState
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


def stretched(share):
    """A recording whose hand records poses that are too long along x of its base by a share."""

    def recorded(pose):
        return RobotState(SE3(pose.rotation, pose.translation * [1 + share, 1, 1]))

    samples = tuple(
        replace(s, robots={**s.robots, "hand": recorded(s.robots["hand"].base_from_flange)})
        for s in MADE.recording.samples
    )
    return replace(MADE.recording, samples=samples)


def about(recording):
    """The situation of a recording, and its solution."""
    solution = solve(MADE.cell, recording, STATED)
    problem = solution.noise.hold_sigmas(solution.problem)
    return Situation(problem, solution.state, problem, {}, solution.noise), solution


@pytest.mark.parametrize(("is_total", "robots"), [(False, ["eye", "hand"]), (True, [])])
def test_a_repeatability_says_nothing_of_accuracy(is_total, robots):
    """Arms that state it have fields; those that state all their noise have none."""
    situation, _ = about(MADE.recording)
    assert [field.robot for field in stated_fields(with_kind(MADE.cell, is_total), situation)] == robots


def test_arms_that_record_joints_have_none():
    """Their joints and links are what errs."""
    made = simulate(Scenario(samples=12, joints=True, robot_noise=(3e-5, 1e-4)), 2)
    solution = solve(made.cell, made.recording, STATED)
    situation = Situation(solution.problem, solution.state, solution.problem, {}, solution.noise)
    assert pose_field(situation, "eye") is None


def test_a_field_is_all_of_its_variance_far_away():
    """At recorded poses hardly any is left; at two metres from all of them nothing is known."""
    situation, _ = about(MADE.recording)
    field = pose_field(situation, "hand")
    poses = situation.recorded_pose(0, "hand")
    far = SE3(poses.rotation, poses.translation + np.array([2.0, 0.0, 0.0]))
    assert field.unknown_share(poses).max() < 0.1
    assert field.unknown_share(far).min() > 0.95
    assert field.flange_tangents(poses).shape == (24, 6, field.width)
    np.testing.assert_allclose(variances(4e-8), [4e-8, 1.6e-7])


def test_the_data_tell_how_large_a_field_is():
    """An arm that is right has hardly any; one that is half a percent long along an axis, as much as expected."""
    sizes = []
    for share in (0.0, 5e-3):
        situation, _ = about(stretched(share))
        sizes.append(size_posterior(situation, [pose_field(situation, "hand")]).field_m2)
    assert np.sqrt(sizes[0]) < 2e-4
    assert np.sqrt(sizes[1]) > 4e-4
    assert np.sqrt(sizes[1]) <= PRIOR_M.sigmas.max()


def test_an_answer_is_as_wide_as_its_arms_are_wrong():
    """Of right arms by a fifth at most, of a long one by several times; and it does not move by a field."""
    ratios = []
    for share in (0.0, 5e-3):
        _, solution = about(stretched(share))
        wide, plain = (with_expected_sizes(with_kind(MADE.cell, total), solution, None) for total in (False, True))
        name = MADE.cell.requested_transforms[0]
        ratio = np.diag(wide.transforms[name].covariance) / np.diag(plain.transforms[name].covariance)
        ratios.append(float(np.exp(0.5 * np.log(ratio).mean())))
    assert 1 <= ratios[0] < 1.2
    assert ratios[1] > 1.5
