"""Tests of Jacobians of views by the unknowns against finite differences."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.derivatives import check_derivative
from tests.pose_problem import pose_problem

from basecal.effects import joint_offsets, link_parameters
from basecal.estimation.least_squares.jacobians import robot_model_jacobian, stop_error_jacobians, unknown_jacobian
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.robot_parameters import RobotModel, apply_step, robot_model
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, IntArray
from basecal.simulation import Scenario, simulate
from quick import quick

CELLS = {
    "dual": Scenario(samples=4, target="points", robot_noise=(2e-3, 3e-3)),
    "eye to hand": Scenario(samples=4, layout="eye_to_hand", target="led", robot_noise=(2e-3, 3e-3)),
    "ring": Scenario(samples=9, layout="chain", robot_noise=(2e-3, 3e-3)),
    "two cameras on the world": Scenario(samples=4, layout="two_world_cameras"),
}


def problem_near_truth(scenario: Scenario) -> tuple[Problem, State]:
    made = simulate(scenario, seed=2)
    problem, _ = build_problem(made.cell, made.recording)
    errors = np.random.default_rng(0).standard_normal((len(problem.stops), 6))
    return problem, State(made.truth, made.cameras, errors)


def view_tangents(problem: Problem, group: ViewGroup, state: State, after: State) -> np.ndarray:
    """Tangents (n, 6) of the views from one state to another."""
    before = chain(group, state, problem.stops).camera_from_target
    return (before.inverse() @ chain(group, after, problem.stops).camera_from_target).log()


@pytest.mark.parametrize("name", CELLS)
def test_jacobian_by_every_unknown(name):
    """The derivatives of views by camera mount, base and target mount are correct in every group of the cell."""
    problem, state = problem_near_truth(CELLS[name])
    for group in problem.groups:
        links = chain(group, state, problem.stops)
        derivative, columns = unknown_jacobian(problem, group, links, state, 6)
        names = [n for n, where in problem.columns.items() if where.start in columns]
        assert len(names) >= 2
        for unknown in names:
            where = problem.columns[unknown]
            width = where.stop - where.start

            def after(xi: np.ndarray, unknown: str = unknown, group: ViewGroup = group) -> np.ndarray:
                step = SE3.exp(np.concatenate([xi, np.zeros(6 - len(xi))]))
                moved = {**state.transforms, unknown: state.transforms[unknown] @ step}
                return view_tangents(problem, group, state, replace(state, transforms=moved))

            start = int(np.flatnonzero(columns == where.start)[0])
            check_derivative(after, derivative[..., start : start + width])


@pytest.mark.parametrize("name", ["dual", "eye to hand", "ring"])
def test_jacobian_by_stop_errors(name):
    """The derivatives are correct at errors of order one sigma, not only at zero."""
    problem, state = problem_near_truth(CELLS[name])
    checked = 0
    for group in problem.groups:
        links = chain(group, state, problem.stops)
        for stop, derivative in stop_error_jacobians(group, links, state, problem.stops, 6):

            def after(xi: np.ndarray, stop: IntArray = stop, group: ViewGroup = group) -> np.ndarray:
                errors = state.stop_errors.copy()
                errors[np.unique(stop)] += xi
                return view_tangents(problem, group, state, replace(state, stop_errors=errors))

            size = np.abs(derivative).max()
            check_derivative(lambda xi, f=after, s=size: f(xi) / s, derivative / size)
            checked += 1
    assert checked >= len(problem.groups)


@pytest.mark.journey
@pytest.mark.parametrize("noise", quick([None, (2e-3, 3e-3)], [(2e-3, 3e-3)]))
def test_jacobian_by_robot_kinematics(noise):
    """Joints of both arms are off, and links of one, beside stop errors of order one sigma."""
    made = simulate(Scenario(samples=2, target="points", joints=True, robot_noise=noise or (0.0, 0.0)), 2)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    offsets = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01)}
    links = {"link_parameters": link_parameters.Stated(status="prior", sigma_m=0.01, sigma_rad=0.01)}
    chains = {name: made.cell.robots[name].chain for name in ("eye", "hand")}
    models = {
        "eye": robot_model("eye", chains["eye"], offsets, group.eye.joints),
        "hand": robot_model("hand", chains["hand"], offsets | links, group.hand.joints),
    }
    problem = problem.with_models(models)
    errors = np.random.default_rng(0).standard_normal((len(problem.stops), 6))
    assert bool(len(errors)) == (noise is not None)
    state = State(made.truth, made.cameras, errors)
    start = {name: apply_step(model, state.kinematics(model), some_step(model)) for name, model in models.items()}
    state = replace(state, robots=start)
    derivative, columns = robot_model_jacobian(problem, group, chain(group, state, problem.stops), state, 8)
    assert derivative.shape == (2, 8, len(columns))
    assert not np.any(derivative[:, 6:])
    assert sorted(columns) == [
        k for m in models.values() for n in m.widths for k in range(problem.width)[problem.columns[n]]
    ]
    for name, model in models.items():
        of = np.concatenate([np.arange(problem.width)[problem.columns[n]] for n in model.widths])

        def after(step: np.ndarray, name: str = name, model: RobotModel = model) -> np.ndarray:
            parts = np.split(step, np.cumsum([*model.widths.values()])[:-1])
            moved = apply_step(model, state.robots[name], dict(zip(model.widths, parts, strict=True)))
            return view_tangents(problem, group, state, replace(state, robots={**state.robots, name: moved}))

        at = [int(np.flatnonzero(columns == k)[0]) for k in of]
        check_derivative(after, derivative[:, :6][..., at], tolerance=1e-8)


def some_step(model: RobotModel) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {name: 0.02 * rng.standard_normal(width) for name, width in model.widths.items()}


def test_unchanged_robots_have_no_columns():
    """Robots with fixed kinematics have no derivatives."""
    problem, state = problem_near_truth(CELLS["dual"])
    (group,) = problem.groups
    derivative, columns = robot_model_jacobian(problem, group, chain(group, state, problem.stops), state, 6)
    assert derivative.shape == (4, 6, 0)
    assert len(columns) == 0


def test_lens_columns_exist_for_lens_rows():
    """A lens has one column for each parameter, behind those of the transforms.

    With rows of a pose alone there are none.
    """
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6))
    (group,), links = problem.groups, chain(problem.groups[0], state, problem.stops)
    free = replace(problem, columns={**problem.columns, "camera": slice(6, 10)})
    derivative, columns = unknown_jacobian(free, group, links, state, 10)
    assert columns.tolist() == [*range(10)]
    np.testing.assert_array_equal(derivative[:, 6:, 6:], np.tile(np.eye(4), (3, 1, 1)))
    assert not derivative[:, 6:, :6].any()
    assert not derivative[:, :6, 6:].any()
    of_pose, columns = unknown_jacobian(free, group, links, state, 6)
    assert columns.tolist() == [*range(6)]
    np.testing.assert_array_equal(of_pose, derivative[:, :6, :6])


def test_views_without_unknowns_have_no_columns():
    """A robot recorded by poses has no columns either, whatever is requested of its kinematics."""
    problem, state = pose_problem(np.zeros((3, 6)), np.ones(6))
    (group,), links = problem.groups, chain(problem.groups[0], state, problem.stops)
    asked = SimpleNamespace(robot_model=lambda robot: robot and SimpleNamespace())
    for derivative, columns in (
        unknown_jacobian(replace(problem, columns={}), group, links, state, 6),
        robot_model_jacobian(asked, group, links, state, 6),
    ):
        assert derivative.shape == (3, 6, 0)
        assert columns.shape == (0,)


def test_robot_kinematics_do_not_affect_the_lens():
    """Rows of the lens are zero, and those of the pose are the same as without it."""
    made = simulate(Scenario(samples=2, target="points", joints=True, joint_offsets="prior", joint_offset_rad=0.01), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    (group,), links = problem.groups, chain(problem.groups[0], state, problem.stops)
    of_pose, columns = robot_model_jacobian(problem, group, links, state, 6)
    with_lens, same = robot_model_jacobian(problem, group, links, state, 11)
    np.testing.assert_array_equal(columns, same)
    np.testing.assert_array_equal(with_lens[:, :6], of_pose)
    assert not with_lens[:, 6:].any()
