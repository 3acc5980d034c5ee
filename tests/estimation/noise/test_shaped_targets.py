"""Tests of targets with shape errors: estimated, propagated to the covariance, and absent without errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.points import points_target
from basecal.effects.target_shape import is_flat, point_shifts_m, unit_bow, unit_shifts
from basecal.estimation.noise.shaped_targets import reshape_targets, shaped_points, shaped_targets
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

BOARD = chessboard_target((9, 6), 0.04)
BODY = points_target(0.06 * np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 1) for z in (-1, 1)]))
NOISY = Scenario(
    target="chessboard",
    board=BOARD,
    samples=25,
    arms="eye_still",
    camera_mount="fixed",
    robot_noise=(2e-4, 3e-4),
    state_robot_noise=False,
    state_pixel_noise=False,
)
IN_SPACE = replace(NOISY, target="points", board=BODY)
ESTIMATED = Settings(robot_noise="estimated")
CHI2_LIMIT = {3: 21.1, 6: 27.9, 30: 70.1}  # by freedoms: one in ten thousand


def simulate_shape_error(scenario, shape, seed=0):
    """A cell as stated, and one whose target has this shape error in sigmas with unchanged stated points."""
    target = scenario.board
    other = replace(target, points=target.points + unit_shifts(target.points) @ shape)
    return simulate(scenario, seed), simulate(replace(scenario, board=other), seed)


def problem_of(scenario):
    """The problem of a cell."""
    made = simulate(scenario, 0)
    return build_problem(made.cell, made.recording)[0]


def test_bowed_board_is_flat():
    """A board with a bow of ten sigmas is flat, and a target with depth is not."""
    assert is_flat(BOARD.points + 10 * unit_bow(BOARD.points)[..., 0])
    assert not is_flat(BODY.points)
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    assert is_flat(cube * [1.0, 0.7, 0.049])
    assert not is_flat(cube * [1.0, 0.7, 0.051])


def problem_of_points(points, stated=False):
    """A problem of a target of such points in three views."""
    (group,) = (problem := problem_of(replace(NOISY, samples=3))).groups
    count = len(points)
    measurement = replace(
        group.measurement,
        points_in_target=points,
        pixels=np.zeros((3, count, 2)),
        seen=np.ones((3, count), dtype=bool),
        stated=np.full((3, count), float(stated)),
        weight=np.ones((3, count)),
    )
    return problem.with_groups([replace(group, measurement=measurement, readings=())])


@pytest.mark.parametrize(
    ("points", "coefficients"),
    [
        (BOARD.points[:8], 0),
        (BOARD.points[:9], 0),  # a row of a board
        (BOARD.points[:18], 3),
        (BOARD.points[[0, 1, 2, 9, 10, 11, 18, 19, 20]], 3),
        (np.random.default_rng(0).uniform(-1, 1, (8, 3)), 0),
        (np.random.default_rng(0).uniform(-1, 1, (9, 3)), 27),
        (np.random.default_rng(0).uniform(-1, 1, (40, 3)), 120),
        (np.random.default_rng(0).uniform(-1, 1, (41, 3)), 0),
    ],
)
def test_number_of_shape_coefficients(points, coefficients):
    """Targets of nine points or more have three in a plane, and three for each of up to 40 points in space.

    A line, or a board with stated sigmas, has none.
    """
    expected = {"board": coefficients} if coefficients else {}
    assert shaped_targets(problem_of_points(points)) == expected
    assert shaped_targets(problem_of_points(points, stated=True)) == (expected if coefficients > 3 else {})


def test_poses_have_no_shape():
    """Measurements of poses have no points and no shape. They are unchanged, like targets without a given shape."""
    problem, _ = pose_problem(np.zeros((2, 6)), None)
    assert shaped_points(problem.groups[0]).shape == (0, 3)
    assert shaped_targets(problem) == {}
    same = reshape_targets(problem, {"target": np.ones(3)})
    assert same.groups == problem.groups
    other = problem_of_points(BOARD.points)
    assert reshape_targets(other, {"another": np.ones(3)}).groups == other.groups


def test_shape_coefficients_of_boards_and_bodies():
    """A board has the coefficients of a bow, and a body one for each coordinate.

    Each is half a percent of the half size. Shifts and rotations of the whole body are removed.
    """
    np.testing.assert_array_equal(unit_shifts(BOARD.points), unit_bow(BOARD.points))
    shape = unit_shifts(BODY.points)
    assert shape.shape == (12, 3, 36)
    np.testing.assert_allclose(unit_shifts(BODY.points + np.array([0.3, -0.1, 0.2])), shape, atol=1e-12)
    half = 0.06 * np.sqrt(3)
    assert np.linalg.matrix_rank(shape.reshape(36, 36), tol=1e-9) == 30
    np.testing.assert_allclose(np.linalg.norm(shape.reshape(36, 36), 2), 5e-3 * half, rtol=1e-9)
    np.testing.assert_allclose(shape.sum(0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cross(BODY.points[:, None], np.moveaxis(shape, 1, -1)).sum(0), 0, atol=1e-12)


@pytest.mark.parametrize(("scenario", "shape"), [(NOISY, [2.0, -1.0, 1.0]), (IN_SPACE, np.linspace(-2, 2, 36))])
def test_reshaping_is_reversible(scenario, shape):
    """Coefficients are absolute: a problem shaped and shaped back nearly has its original points."""
    problem = problem_of(replace(scenario, samples=3))
    there = reshape_targets(problem, {"board": np.array(shape)})
    back = reshape_targets(there, {"board": np.zeros(len(shape))})
    at = [p.groups[0].measurement.points_in_target for p in (problem, there, back)]
    np.testing.assert_allclose(at[1] - at[0], unit_shifts(at[0]) @ shape, atol=1e-12)
    np.testing.assert_array_equal(there.shapes["board"], shape)
    off = point_shifts_m(at[0], np.array(shape))
    np.testing.assert_allclose(np.linalg.norm(at[1] - at[0], axis=-1), off, atol=1e-12)
    np.testing.assert_allclose(at[2], at[0], atol=0.02 * off.max())


def test_shaped_targets_have_enough_points():
    """Targets with an estimated shape have nine points or more, at most 40 in space.

    Boards have a shape only if pixels have no stated sigma.
    """
    few = {"samples": 3}
    assert shaped_targets(problem_of(replace(NOISY, **few))) == {"board": 3}
    assert shaped_targets(problem_of(replace(NOISY, **few, state_pixel_noise=True))) == {}
    assert shaped_targets(problem_of(replace(IN_SPACE, **few, state_pixel_noise=True))) == {"board": 36}
    many = points_target(np.random.default_rng(0).uniform(-0.06, 0.06, (41, 3)))
    assert shaped_targets(problem_of(replace(IN_SPACE, **few, board=many))) == {}
    for other in ({"target": "led", "board": None}, {"target": "points", "board": None}, {"target": "points3d"}):
        assert shaped_targets(problem_of(replace(NOISY, **few, **other))) == {}


@pytest.mark.journey
@pytest.mark.parametrize(
    ("scenario", "truth", "freedoms"),
    [(NOISY, np.array([1.5, -1.0, 0.7]), 3), (IN_SPACE, np.random.default_rng(0).standard_normal(36), 30)],
)
def test_shape_is_estimated_without_bias_of_the_mount(scenario, truth, freedoms):
    """Coefficients and mount agree with their covariance, for a target with and without a shape error."""
    as_stated, off = simulate_shape_error(scenario, truth)
    onto = np.linalg.pinv(unit_shifts(scenario.board.points).reshape(-1, len(truth)), rcond=1e-6)
    projection = onto @ unit_shifts(scenario.board.points).reshape(-1, len(truth))
    for shape, recording in ((truth, off.recording), (0 * truth, as_stated.recording)):
        found = solve(as_stated.cell, recording, ESTIMATED)
        coefficients, spread = found.noise.shapes["board"]
        error = projection @ (coefficients - shape)
        assert error @ np.linalg.pinv(projection @ spread @ projection, rcond=1e-9) @ error < CHI2_LIMIT[freedoms]
        mount = "hand_flange_from_board"
        error = (found.state.transforms[mount].inverse() @ as_stated.truth[mount]).log()
        assert error @ np.linalg.solve(found.joint_transform_covariance([mount]), error) < CHI2_LIMIT[6]
