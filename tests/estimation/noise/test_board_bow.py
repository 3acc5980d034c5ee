"""Boards that are bowed: found, taken into account, and none where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.noise.board_bow import bent, bowed_targets, height_m, shape_of
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

BOARD = chessboard_target((9, 6), 0.04)
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
ESTIMATED = Settings(robot_noise="estimated")
CHI2_LIMIT = 27.9  # of six freedoms: one in ten thousand


def bowed(bow, seed=0):
    """A cell whose board is bowed so [sigmas], though its points are stated flat."""
    made = simulate(NOISY, seed)
    curved = replace(BOARD, points=BOARD.points + shape_of(BOARD.points) @ np.array(bow))
    return made, simulate(replace(NOISY, board=curved), seed)


def test_shape_moves_points_off_their_plane_alone():
    """By the square of the place over the half size: 0.3 % of it at the end of the longer side."""
    shape = shape_of(BOARD.points)
    np.testing.assert_allclose(shape[:, :2, :], 0.0, atol=1e-12)
    assert np.abs(shape[:, 2, :]).max() == pytest.approx(3e-3 * 0.16, rel=1e-6)


def test_bending_is_undone_by_the_opposite():
    """Coefficients are absolute: a problem bent to zero has the points it began with, to a nanometre."""
    problem, _ = build_problem(*parts(NOISY))
    twice = bent(bent(problem, {"board": np.array([2.0, -1.0, 1.0])}), {"board": np.zeros(3)})
    before, after = (p.groups[0].measurement.points_in_target for p in (problem, twice))
    np.testing.assert_allclose(after, before, atol=1e-8)


def test_which_targets_may_bow():
    """Flat ones of nine points and more whose pixels state no sigma; no light, no tag, nothing in space."""
    one = {"samples": 3}
    assert bowed_targets(build_problem(*parts(replace(NOISY, **one)))[0]) == ("board",)
    for other in ({"state_pixel_noise": True}, {"target": "led", "board": None}, {"target": "points", "board": None}):
        assert bowed_targets(build_problem(*parts(replace(NOISY, **one, **other)))[0]) == ()


def parts(scenario):
    """Cell and recording."""
    made = simulate(scenario, 0)
    return made.cell, made.recording


def test_height_is_that_off_the_points_own_plane():
    """Tilt and shift of the surface do not count: a twist of one sigma lifts the corner (1, 5/8) by its product."""
    assert height_m(BOARD.points, np.array([0.0, 1.0, 0.0])) == pytest.approx(3e-3 * 0.16 * 5 / 8, rel=1e-6)


def test_a_bow_is_found_and_costs_the_mount_nothing():
    """Coefficients and mount are where their covariance says, of a bowed board and of a flat one."""
    truth = np.array([1.5, -1.0, 0.7])
    flat, curved = bowed(truth)
    for bow, recording in ((truth, curved.recording), (np.zeros(3), flat.recording)):
        found = solve(flat.cell, recording, ESTIMATED)
        coefficients, spread = found.noise.bows["board"]
        off = coefficients - bow
        assert off @ np.linalg.solve(spread, off) < CHI2_LIMIT
        mount = "hand_flange_from_board"
        error = (found.state.transforms[mount].inverse() @ flat.truth[mount]).log()
        assert error @ np.linalg.solve(found.covariance_of([mount]), error) < CHI2_LIMIT
