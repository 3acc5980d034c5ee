"""Tests of gauges from recorded flange poses: parameters that cannot be separated from other free transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.touch_cells import recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Cell, Recording
from basecal.cell.targets.points import points_target
from basecal.effects import deflection, joint_offsets, link_parameters
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.gauges import (
    LEAST_RMS_RAD,
    determined_directions,
    determined_joints,
    end_moves,
    held_gauges,
    independent_moves,
)
from basecal.estimation.problem.robot_parameters import robot_model
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

OFFSETS = {"joint_offsets": joint_offsets.Stated(status="free")}
LINKS = {"link_parameters": link_parameters.Stated(status="free")}
ENDS = [(False, False), (True, False), (False, True), (True, True)]


def determined_offsets(arm, joints, ends):
    return robot_model("hand", arm, OFFSETS, joints, ends).columns["joint_offsets"].basis.argmax(axis=0).tolist()


def link_basis(arm, joints, ends, **beside):
    return robot_model("hand", arm, {**beside, **LINKS}, joints, ends).columns["link_parameters"].basis


@pytest.mark.parametrize("ends", ENDS)
def test_free_ends_absorb_the_first_and_last_joint(arm, joints, ends):
    """The offset of the first joint equals a change of the base, that of the last a change of the mount.

    The others are determined.
    """
    held = {0} if ends[0] else set()
    held |= {5} if ends[1] else set()
    assert set(range(6)) - set(determined_offsets(arm, joints, ends)) == held


def test_still_joint_passes_its_gauge_on(arm, joints):
    """If the first joint is still, the second rotates about an axis fixed in the base, too.

    The same holds at the end.
    """
    turntable = joints * np.array([0, 1, 1, 1, 1, 1]) + 0.3
    assert determined_offsets(arm, turntable, (True, False)) == [2, 3, 4, 5]
    assert determined_offsets(arm, turntable, (False, False)) == [0, 1, 2, 3, 4, 5]
    assert determined_offsets(arm, joints * np.array([1, 1, 1, 1, 1, 0]), (False, True)) == [0, 1, 2, 3]


def test_prior_keeps_gauge_parameters(arm, joints):
    """Along a gauge, the result is that of the prior."""
    stated = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01)}
    columns = robot_model("hand", arm, stated, joints, (True, True)).columns["joint_offsets"]
    np.testing.assert_array_equal(columns.basis, np.eye(6))


def test_first_joint_of_a_gauge_is_held():
    """Two joints move the flange equally and one differently: the first of the pair is held."""
    moves = np.random.default_rng(0).standard_normal((8, 6, 3))
    moves[..., 2] = moves[..., 1]
    assert determined_joints(moves, np.zeros((8, 6, 0))).tolist() == [0, 2]


@pytest.mark.parametrize(("size", "determined"), [(2.0, 1), (0.5, 0)])
def test_motions_within_noise_are_not_informative(size, determined):
    """Motions at twice and half the rms limit are tested, with half a metre as a radian.

    Only the larger ones determine a direction.
    """
    moves = np.zeros((4, 6, 1))
    moves[:, 0, 0] = 0.5 * size * LEAST_RMS_RAD
    assert determined_directions(moves, np.zeros((4, 6, 0))).shape == (1, determined)


def test_independent_moves_exclude_those_of_others(rng):
    """Moves that are sums of others and a remainder have the squares of the remainder alone."""
    others, rest = rng.standard_normal((20, 6, 3)), np.zeros((20, 6, 1))
    rest[:, 4] = rng.standard_normal((20, 1))
    flat = others.reshape(120, 3) / np.tile([0.5] * 3 + [1.0] * 3, 20)[:, None]
    own = rest.reshape(120, 1)
    left = own - flat @ np.linalg.lstsq(flat, own, rcond=None)[0]
    found = independent_moves(rest + others @ np.ones((3, 1)), others)
    np.testing.assert_allclose(found.values, np.sum(left**2) / 20, rtol=1e-9)
    np.testing.assert_allclose(np.abs(found.vectors), 1)


def test_end_moves_equal_base_and_mount_moves(arm, joints):
    """A twist of the base is transformed by the adjoint, in units of half a metre and a radian.

    Without free ends there is none.
    """
    flange = arm.forward(joints)
    moves = end_moves(flange, (True, True))
    np.testing.assert_allclose(moves[..., :3], 0.5 * flange.inverse().adjoint()[..., :3], atol=1e-15)
    np.testing.assert_allclose(moves[0, :, 6:], np.diag([0.5] * 3 + [1.0] * 3))
    assert end_moves(flange, (False, False)).shape == (30, 6, 0)


def test_link_gauges_through_joints_have_no_columns(arm, joints):
    """Each joint has two gauges without free ends. A free base and free mounts remove further columns."""
    counts = [link_basis(arm, joints, ends).shape[1] for ends in ENDS]
    assert counts == [42 - 12, 42 - 12 - 6, 42 - 12 - 6, 18]


def test_link_columns_and_free_ends_span_all_errors(arm, joints):
    """The remaining 18 columns and the two transforms span the same space as the 42 and the transforms."""
    basis = link_basis(arm, joints, (True, True))
    links, poses = arm.posture(joints).link_derivative, arm.forward(joints)
    ends = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (30, 6, 6))], -1)
    kept = np.concatenate([links @ basis, ends], -1).reshape(180, -1)
    every = np.concatenate([links, ends], -1).reshape(180, -1)
    assert np.linalg.matrix_rank(kept) == 30 == np.linalg.matrix_rank(every)


def test_link_columns_have_minimum_norm(arm, joints):
    """No column has a component along a gauge, such as a rotation about a joint's axis.

    Half a metre counts as a radian.
    """
    basis = link_basis(arm, joints, (False, False)) / np.tile([0.5] * 3 + [1.0] * 3, 7)[:, None]
    np.testing.assert_allclose(basis.T @ basis, np.eye(30), atol=1e-12)
    passed = np.zeros(42)
    passed[9:12] = arm.axes[1]
    passed[12:18] = -arm.origins[2].inverse().adjoint() @ np.append(np.zeros(3), arm.axes[1])
    assert np.abs(arm.posture(joints).link_derivative @ passed).max() < 1e-12
    np.testing.assert_allclose(basis.T @ (passed / np.tile([0.5] * 3 + [1.0] * 3, 7)), 0, atol=1e-6)


def test_joint_offsets_replace_link_rotations_about_axes(arm, joints):
    """Links have one column less for each joint, except those that the free ends already absorb."""
    alone, beside = link_basis(arm, joints, (True, True)), link_basis(arm, joints, (True, True), **OFFSETS)
    assert alone.shape[1] - beside.shape[1] == 4


def test_compliance_with_constant_torque_is_an_offset(arm, joints):
    """Gravity has no torque about a vertical first axis, nor about the last, on which its mass lies."""
    free = deflection.Stated(status="free")
    kept = robot_model("hand", arm, {**OFFSETS, "deflection": free}, joints).columns["deflection"].basis.argmax(axis=0)
    assert kept.tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize(("size", "left"), [(0.5, 1.0), (2.0, 0.0)])
def test_negligible_moves_do_not_absorb_others(size, left, count):
    """Moves of others at half and twice the rms limit of motion are tested, along the same direction.

    Only the larger ones absorb it.
    """
    moves = np.zeros((count, 6, 1))
    moves[:, 4, 0] = 1.0
    found = independent_moves(moves, size * LEAST_RMS_RAD * moves)
    np.testing.assert_allclose(found.values, [left], atol=1e-9)


def test_one_joint_of_each_gauge_is_held():
    """Two pairs of joints move the flange equally: the first of each is held.

    Of three dependent joints, one is held.
    """
    moves = np.random.default_rng(0).standard_normal((8, 6, 4))
    moves[..., 1], moves[..., 3] = 2.0 * moves[..., 0], moves[..., 2]
    determined = determined_joints(moves, np.zeros((8, 6, 0)))
    assert len(determined) == 2
    assert np.linalg.matrix_rank(moves[..., determined].reshape(48, 2)) == 2
    two = np.concatenate([moves[..., [0, 2]], moves[..., [0]] + moves[..., [2]]], -1)
    assert len(determined_joints(two, np.zeros((8, 6, 0)))) == 2


LINE = {"socket_1": [0.0, 0.0, 0.0], "socket_2": [0.0, 0.05, 0.0]}


def test_rotation_about_a_line_of_marks_is_held():
    """For marks along y, the rotation about y is held, and for a plate of three marks nothing is."""
    cell = touch_cell((), marks={"plate": {"points_m": LINE}, "wide": {"points_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}})
    held = held_gauges(cell, ())
    assert held["eye_base_from_plate"].tolist() == [0, 0, 0, 0, 1, 0]
    assert "eye_base_from_wide" not in held


@pytest.mark.journey
def test_arm_is_calibrated_by_two_sockets():
    """One arm that touches two sockets has a good verdict and a correct tip."""
    cell = touch_cell((), marks={"plate": {"points_m": LINE}}, robots={"eye": {"noise": NOISE}}, tips=TIP)
    marks = {name: np.array([0.4, 0.1, 0.2]) + at for name, at in LINE.items()}
    lines = [line for line in touch_lines(np.random.default_rng(0), 48, 1e-4, marks) if "eye" in line["robots"]]
    found = calibrate(cell, recorded(cell, lines))
    assert found.verdict == "good"
    assert found["eye_flange_from_eye_tip"].mean.translation == pytest.approx([0.02, -0.01, 0.15], abs=5e-4)


NOISE = {"sigma_t_m": 1e-6, "sigma_r_rad": 1e-6}
TIP = {"eye_tip": {"on": "eye"}}


def _point_cell(status: str = "free") -> tuple[Cell, Recording]:
    """Measured poses of a target that is declared as one point."""
    made = simulate(Scenario(samples=12, target="pose", target_mount=status), seed=0)
    board = replace(made.cell.targets["board"], target=points_target([[0.0, 0.0, 0.0]]))
    return replace(made.cell, targets={"board": board}), made.recording


def test_point_measured_as_poses_has_an_orientation():
    """The mount of a point measured as poses has six columns, and the result equals that of a target without a kind."""
    cell, recording = _point_cell()
    solution = solve(cell, recording)
    assert solution.problem.point_mounts == frozenset()
    plain = replace(cell, targets={"board": replace(cell.targets["board"], target=None)})
    for name, estimate in solve(plain, recording).transforms.items():
        np.testing.assert_allclose(solution.transforms[name].mean.matrix, estimate.mean.matrix, atol=1e-9)
        np.testing.assert_allclose(solution.transforms[name].covariance, estimate.covariance, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("status", ["fixed", "prior"])
def test_stated_point_mount_has_no_orientation_for_poses(status):
    """A fixed or prior mount of a point, measured as poses, is refused, and the error says what to leave out."""
    with pytest.raises(InputError, match="Leave out its `kind`"):
        build_problem(*_point_cell(status))


@pytest.mark.parametrize(("target", "points"), [("led", {"hand_flange_from_board"}), ("points", set())])
def test_single_led_is_a_point(target, points):
    """The mount of a single LED is a point, that of several points is not."""
    made = simulate(Scenario(samples=8, target=target), seed=0)
    assert build_problem(made.cell, made.recording)[0].point_mounts == points
