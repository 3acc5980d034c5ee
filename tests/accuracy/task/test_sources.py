"""Sources of error, each scaled by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.task.sources import error_sources
from basecal.cell import Recording
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
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
    assert [source.name for source in error_sources(solution.problem)] == [
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
    for source in error_sources(problem):
        problem, state = source.scaled(problem, state, 2.0)
    after = linearise(problem, state).hessian
    np.testing.assert_allclose(4 * after, before, rtol=0, atol=1e-7 * np.abs(before).max())


def test_a_scaled_source_leaves_the_state_where_it_is(solution):
    """Errors of stops stay what they are in metres: every view is predicted as before."""
    (source,) = [each for each in error_sources(solution.problem) if each.name == "repeatability of eye"]
    problem, state = source.scaled(solution.problem, solution.state, 3.0)
    (group,) = problem.groups
    before = solution.state.camera_from_target(group, solution.problem.stops)
    np.testing.assert_allclose(state.camera_from_target(group, problem.stops).matrix, before.matrix, atol=1e-14)


def test_a_source_is_that_of_its_name_alone():
    """Views of one of two cameras, stops of one of two robots and the prior of one of them; the others stay."""
    made = simulate(EVERYTHING, 3)
    twin = replace(made.cell.cameras["wrist"], name="second")
    cell = replace(made.cell, cameras={**made.cell.cameras, "second": twin})
    samples = [
        replace(s, observations=(*s.observations, *(replace(o, camera="second") for o in s.observations)))
        for s in made.recording.samples
    ]
    problem, _ = build_problem(cell, Recording(tuple(samples)))
    state = State({}, {}, np.zeros((len(problem.stops), 6)))
    scaled = {source.name: source.scaled(problem, state, 2.0)[0] for source in error_sources(problem)}
    assert {"views of second", "prior of eye_flange_from_second", "lens of second"} <= scaled.keys()
    for name, other in scaled.items():
        weights = {f"views of {g.camera}": g.measurement.weight for g in problem.groups}
        after = {f"views of {g.camera}": g.measurement.weight for g in other.groups}
        for each, weight in weights.items():
            np.testing.assert_allclose(after[each], weight / (2.0 if each == name else 1.0))
        for robot in ("eye", "hand"):
            mine = np.array(problem.stops.robot) == robot
            factor = 2.0 if name == f"repeatability of {robot}" else 1.0
            np.testing.assert_allclose(other.stops.sigma[mine], factor * problem.stops.sigma[mine])
        for unknown, of in problem.unknowns.items():
            if of.sigma is not None:
                factor = 2.0 if name == f"prior of {unknown}" else 1.0
                np.testing.assert_allclose(other.unknowns[unknown].sigma, factor * of.sigma)
        for camera, lens in problem.lenses.items():
            factor = 2.0 if name == f"lens of {camera}" else 1.0
            np.testing.assert_allclose(other.lenses[camera].sigma, factor * lens.sigma)
