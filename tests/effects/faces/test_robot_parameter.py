"""Tests of robot parameters and their lines in the report."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import RobotParameters
from basecal.effects.faces.robot_parameter import (
    Posture,
    RobotParameter,
    draw_by_joint,
    from_dict,
    joint_candidates,
    joint_columns,
    joint_lines,
    moves_by_joint,
    to_dict,
    unestimated_chains,
)
from basecal.simulation import Scenario
from basecal.simulation.arms import six_axis
from made_views import moved_by_pose, views_of


def test_joint_lines_mark_unobservable_values():
    """Values are in the requested unit; prior-dominated values are marked, and unobservable ones have no number."""
    of = np.array([0.001, -0.0, np.nan])
    found = RobotParameters(("a", "long", "c"), of, np.array([0.01, 0.02, np.nan]), np.array([True, False, False]))
    assert [line.split() for line in joint_lines(found, 1e3, "mm", 1)] == [
        ["1", "a", "+1.0", "mm", "sigma", "10.0", "mm"],
        ["2", "long", "+0.0", "mm", "sigma", "20.0", "mm", "prior-dominated"],
        ["3", "c", "unobservable"],
    ]


def test_unit_value_rotates_its_joint():
    """A unit rotates its joint by the effect's value at the recorded joints.

    Views that the robot does not carry have no moves.
    """
    views = views_of(Scenario(samples=6, joints=True))
    ((_, chain), *_) = unestimated_chains(views, "made_up")
    (moves,) = moves_by_joint(views, "eye", chain, lambda _, joints: 3 * joints)
    joints = views.groups[0].eye.joints
    moved = chain.forward(joints + 1e-7 * 3 * joints * np.eye(6)[2])
    np.testing.assert_allclose(1e-7 * moves[..., 2], moved_by_pose(views, "eye", moved), atol=1e-11)
    assert moves_by_joint(views, "nobody", chain, lambda _, joints: joints) == (None,)


def test_joint_candidates_are_single_and_joined():
    """The same moves form b candidates of one size, and one candidate of b sizes."""
    moves = (np.arange(36.0).reshape(2, 6, 3), None)
    each, together = joint_candidates("gear", "eye", "", moves)
    assert (each.code, each.about, each.joint, each.sizes) == ("gear", ("eye",) * 3, (0, 1, 2), 1)
    assert (together.code, together.about, together.sizes) == ("gears", ("eye",), 3)
    np.testing.assert_array_equal(np.moveaxis(each.moves[0][..., 0], 1, 2), together.moves[0][:, 0])
    assert each.moves[1] is together.moves[1] is None


def test_estimated_parameters_are_not_candidates():
    """Robots whose parameter is estimated are excluded, each separately."""
    views = views_of(Scenario(samples=6, joints=True, joint_offset_rad=1e-3, joint_offsets="prior"))
    assert [robot for robot, _ in unestimated_chains(views, "joint_offsets")] == []
    assert [robot for robot, _ in unestimated_chains(views, "deflection")] == ["eye", "hand"]


def test_parameter_values_and_sigmas_round_trip():
    """Values and sigmas are written under their keys and read back; without robots the field is null."""
    found = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([True, False]))
    written = to_dict("gears", ("ratio", "sigma_ratio"), {"arm": found})
    assert written["gears"]["arm"]["ratio"] is found.values
    assert written["gears"]["arm"]["sigma_ratio"] is found.sigma
    back = from_dict("gears", ("ratio", "sigma_ratio"), written)["arm"]
    assert (back.joints, back.sigma.tolist(), back.seen.tolist()) == (("a", "b"), [0.3, 0.4], [True, False])
    assert to_dict("gears", ("ratio", "sigma_ratio"), {}) == {"gears": None}


def make_kind(turn=None, chain_derivative=None):
    """Return a kind whose joints rotate by a share of their angles, or one that changes only the chain."""
    unused = (None,) * 5
    return RobotParameter(None, "one", *unused, turn=turn, chain_derivative=chain_derivative)


def test_parameter_shift_scales_joints():
    """One value per joint applies at all rows; a batch of values applies to the same rows."""
    kind, joints = make_kind(lambda chain, statement, joints: 2 * joints), np.arange(8.0).reshape(4, 2)
    values = np.array([[1.0, 10.0], [3.0, -1.0], [0.0, 0.5]])
    np.testing.assert_array_equal(kind.shift(None, None, joints, values[0]), 2 * joints * [1, 10])
    many = kind.shift(None, None, joints, values)
    assert many.shape == (3, 4, 2)
    for found, value in zip(many, values, strict=True):
        np.testing.assert_array_equal(found, 2 * joints * value)
    assert make_kind().shift(None, None, joints, values[0]) == 0.0


def test_parameter_derivative_by_joints_or_chain():
    """The derivative follows from the joints' rotation per unit value, or from the chain's own derivative."""
    chain, joints = six_axis(), np.random.default_rng(0).uniform(-1, 1, (3, 6))
    at = Posture(chain, joints, chain.posture(2 * joints))
    found = make_kind(lambda chain, statement, joints: 3 * joints).derivative(at, None, np.zeros(6))
    np.testing.assert_allclose(found, chain.jacobian(2 * joints) * 3 * joints[:, None, :])
    assert make_kind(chain_derivative=lambda at, values: (at, values)).derivative(at, None, 7) == (at, 7)


def test_parameter_defaults_are_by_joint():
    """A kind has one zero per joint in radians, any sigma, and an unchanged chain unless stated otherwise."""
    kind = make_kind()
    np.testing.assert_array_equal(kind.zero(3), np.zeros(3))
    assert kind.move_chain("chain", np.ones(3)) == "chain"
    assert (kind.is_by_joint, kind.scale, kind.largest_sigma, kind.unobserved) == (True, 1.0, np.inf, None)


def test_each_joint_has_own_column():
    """Columns are free, or have one sigma."""
    free, known = joint_columns(six_axis(), None), joint_columns(six_axis(), 0.3)
    assert free.sigma is None
    np.testing.assert_array_equal(known.sigma, [0.3] * 6)
    np.testing.assert_array_equal(free.basis, np.eye(6))


def test_drawn_joint_values_have_requested_size():
    """Values are drawn from a normal distribution, one per joint."""
    drawn = draw_by_joint(0.2, 4000, np.random.default_rng(0))
    assert drawn.shape == (4000,)
    assert drawn.std() == pytest.approx(0.2, rel=0.05)
    assert drawn.mean() == pytest.approx(0.0, abs=0.02)
    np.testing.assert_allclose(draw_by_joint(0.4, 4000, np.random.default_rng(0)), 2 * drawn)
