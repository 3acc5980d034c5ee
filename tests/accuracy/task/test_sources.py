"""Sources of error, each scaled by itself."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.task.sources import sources_of
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

EVERYTHING = Scenario(
    samples=12,
    robot_noise=(1e-4, 2e-4),
    camera_mount="prior",
    intrinsics="prior",
    joints=True,
    joint_offset_rad=1e-3,
    joint_offsets="prior",
)


@pytest.fixture(scope="module")
def solution():
    made = simulate(EVERYTHING, 3)
    return solve(made.cell, made.recording)


def test_every_source_has_a_name(solution):
    """Views, robots' stops, and each kind of prior."""
    assert [source.name for source in sources_of(solution.problem)] == [
        "views of wrist",
        "repeatability of eye",
        "repeatability of hand",
        "prior of eye_flange_from_wrist",
        "lens of wrist",
        "kinematics of eye",
        "kinematics of hand",
    ]


def test_all_sources_together_scale_the_covariance(solution):
    """With every sigma twice as large the information is a quarter, to rounding: no source is forgotten."""
    problem, state = solution.problem, solution.state
    before = linearise(problem, state).hessian
    for source in sources_of(problem):
        problem, state = source.scaled(problem, state, 2.0)
    after = linearise(problem, state).hessian
    np.testing.assert_allclose(4 * after, before, rtol=0, atol=1e-7 * np.abs(before).max())


def test_a_scaled_source_leaves_the_state_where_it_is(solution):
    """Errors of stops stay what they are in metres: every view is predicted as before."""
    (source,) = [each for each in sources_of(solution.problem) if each.name == "repeatability of eye"]
    problem, state = source.scaled(solution.problem, solution.state, 3.0)
    (group,) = problem.groups
    before = solution.state.camera_from_target(group, solution.problem.stops)
    np.testing.assert_allclose(state.camera_from_target(group, problem.stops).matrix, before.matrix, atol=1e-14)
