"""Lines of joints in the report."""

from __future__ import annotations

import numpy as np

from basecal.cell import RobotParameters
from basecal.effects.faces.robot_parameter import (
    from_dict,
    joint_candidates,
    joint_lines,
    moves_by_joint,
    open_chains,
    to_dict,
)
from basecal.simulation import Scenario
from made_views import moved_by_pose, views_of


def test_lines_of_joints():
    """In the unit requested; what only the prior knows says so, what nothing knows has no number."""
    of = np.array([0.001, -0.0, np.nan])
    found = RobotParameters(("a", "long", "c"), of, np.array([0.01, 0.02, np.nan]), np.array([True, False, False]))
    assert [line.split() for line in joint_lines(found, 1e3, "mm", 1)] == [
        ["1", "a", "+1.0", "mm", "sigma", "10.0", "mm"],
        ["2", "long", "+0.0", "mm", "sigma", "20.0", "mm", "prior-dominated"],
        ["3", "c", "unobservable"],
    ]


def test_a_unit_of_a_value_turns_its_joint():
    """By what the effect says at the recorded joints; views that the robot does not carry stay."""
    views = views_of(Scenario(samples=6, joints=True))
    ((_, chain), *_) = open_chains(views, "made_up")
    (moves,) = moves_by_joint(views, "eye", chain, lambda _, joints: 3 * joints)
    joints = views.groups[0].eye.joints
    moved = chain.forward(joints + 1e-7 * 3 * joints * np.eye(6)[2])
    np.testing.assert_allclose(1e-7 * moves[..., 2], moved_by_pose(views, "eye", moved), atol=1e-11)
    assert moves_by_joint(views, "nobody", chain, lambda _, joints: joints) == (None,)


def test_each_joint_and_all_at_once():
    """The same moves, b of one size or one of b sizes."""
    moves = (np.arange(36.0).reshape(2, 6, 3), None)
    each, together = joint_candidates("gear", "eye", "", moves)
    assert (each.code, each.about, each.joint, each.sizes) == ("gear", ("eye",) * 3, (0, 1, 2), 1)
    assert (together.code, together.about, together.sizes) == ("gears", ("eye",), 3)
    np.testing.assert_array_equal(np.moveaxis(each.moves[0][..., 0], 1, 2), together.moves[0][:, 0])
    assert each.moves[1] is together.moves[1] is None


def test_estimated_effects_are_not_open():
    """Of each robot by itself."""
    views = views_of(Scenario(samples=6, joints=True, joint_offset_rad=1e-3, joint_offsets="prior"))
    assert [robot for robot, _ in open_chains(views, "joint_offsets")] == []
    assert [robot for robot, _ in open_chains(views, "deflection")] == ["eye", "hand"]


def test_values_and_sigmas_are_written_by_their_keys():
    """And read back; nothing of no robot."""
    found = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([True, False]))
    written = to_dict("gears", ("ratio", "sigma_ratio"), {"arm": found})
    assert written["gears"]["arm"]["ratio"] is found.values
    assert written["gears"]["arm"]["sigma_ratio"] is found.sigma
    back = from_dict("gears", ("ratio", "sigma_ratio"), written)["arm"]
    assert (back.joints, back.sigma.tolist(), back.seen.tolist()) == (("a", "b"), [0.3, 0.4], [True, False])
    assert to_dict("gears", ("ratio", "sigma_ratio"), {}) == {"gears": None}
