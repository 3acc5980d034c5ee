"""Tests of joint offsets: columns, messages, and their fields in `calibration.json`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import RobotParameters
from basecal.effects import joint_offsets as of
from basecal.effects.faces.robot_parameter import Unobserved
from basecal.errors import InputError
from basecal.estimation.noise.random_effects import posture_at_stops, shared_errors
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario
from basecal.simulation.arms import six_axis
from made_views import moved_by_pose, views_of
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)
COVARIANCE = np.diag([4.0, 9.0])
FOUND = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([2.0, 3.0]), np.array([True, False]), COVARIANCE)


@pytest.mark.parametrize(("stated", "sigma"), [({"status": "free"}, None), ({"sigma_rad": 0.01}, [0.01] * 6)])
def test_one_offset_column_per_joint(stated, sigma):
    """An offset is in radians, with the prior's sigma if there is one."""
    columns = of.EFFECT.parameter.columns(six_axis(), of.Stated(**{"status": "prior", **stated}))
    np.testing.assert_array_equal(columns.basis, np.eye(6))
    assert (columns.sigma if sigma is None else columns.sigma.tolist()) == sigma


def test_joint_offsets_round_trip():
    """Each quantity is a field by robot, and is read back the same."""
    data = of.to_dict({"arm": FOUND})
    assert data["joint_offsets_rad"]["arm"].tolist() == [0.1, 0.2]
    assert data["joint_offsets_sigma_rad"]["arm"].tolist() == [2.0, 3.0]
    assert data["joint_names"] == {"arm": ("a", "b")}
    (back,) = of.from_dict(data).values()
    assert back.joints == ("a", "b")
    for name in ("values", "sigma", "seen", "covariance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))


def test_missing_joint_offsets_are_null():
    """Without robots every field is null, and null reads as no offsets."""
    nothing = of.to_dict({})
    assert len(nothing) == 5
    assert set(nothing.values()) == {None}
    assert of.from_dict(nothing) == of.from_dict({}) == {}


@pytest.mark.parametrize(("key", "wrong"), [("joint_offsets_rad", [1.0]), ("joint_offsets_covariance", [[1.0]])])
def test_wrong_number_of_offsets_is_refused(key, wrong):
    """Each joint needs exactly one number."""
    with pytest.raises(InputError, match=f"{key} has shape"):
        of.from_dict(of.to_dict({"arm": FOUND}) | {key: {"arm": wrong}})


def test_unobservable_offsets_are_explained():
    """The first and last joints are explained by base and mounts, the others by their small motion.

    The text names what compensates the offsets.
    """
    ends = of.unobserved_reason(
        Unobserved(
            "joints 1 (a) and 4 (d)",
            (
                0,
                3,
            ),
            4,
            "eye_base",
            True,
        )
    )
    assert ends.endswith(
        "joints 1 (a) and 4 (d): the first joint moves the arm as its base does, the last one as the mounts on its "
        "flange do; the sigmas of eye_base and of the mounts contain the remaining uncertainty"
    )
    middle = of.unobserved_reason(Unobserved("joint 2 (b)", (1,), 4, "eye_base", False))
    assert "fixed at zero as a gauge: joint 2 (b): the samples hardly move the others alone;" in middle
    chained = of.unobserved_reason(
        Unobserved(
            "joints 1 (a), 2 (b) and 4 (d)",
            (
                0,
                1,
                3,
            ),
            4,
            "eye_base",
            False,
        )
    )
    assert "joints 1 to 2 move the arm as its base does, in these samples, the last one as the mounts" in chained


def test_shared_offsets_move_flange():
    """Shared errors move the flange to first order like a chain with joint offsets."""
    problem = simulated_problem(SCENARIO)
    at, offsets = posture_at_stops(problem, "eye"), 1e-6 * np.arange(1.0, 7.0)
    off = Kinematics(at.chain, {"joint_offsets": offsets}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(of.shared_errors(at).by_stop @ offsets, moved, atol=1e-10)


def test_estimated_offsets_have_no_random_effect():
    """Estimated offsets, and estimated links, which include them, replace the random effect."""
    for kind in ("joint_offsets", "link_parameters"):
        estimated = replace(SCENARIO, joint_offset_rad=1e-3, link_error=(1e-4, 1e-4), **{kind: "prior"})
        assert shared_errors(of.EFFECT.random, simulated_problem(estimated), "eye") is None


def test_joint_offset_candidate_moves_view():
    """One unit of an offset moves the view like the flange of an arm with that joint offset."""
    views = views_of(Scenario(samples=6, joints=True))
    problem, every = views.problem, list(of.candidates(views))
    assert [(candidates.code, candidates.about[0]) for candidates in every] == [
        (code, robot) for robot in ("eye", "hand") for code in ("joint-offset", "joint-offsets")
    ]
    found = {candidates.about[0]: candidates for candidates in every[::2]}
    for alone, together in zip(every[::2], every[1::2], strict=True):
        np.testing.assert_array_equal(together.moves[0][:, 0], np.moveaxis(alone.moves[0][..., 0], 1, 2))
    assert found.keys() == {"eye", "hand"}
    (group,) = problem.groups
    for robot, joints in (("eye", group.eye.joints), ("hand", group.hand.joints)):
        assert found[robot].joint == tuple(range(6))
        for joint in range(6):
            moved = problem.chains[robot].forward(joints + 1e-6 * np.eye(6)[joint])
            expected = moved_by_pose(views, robot, moved)
            np.testing.assert_allclose(1e-6 * found[robot].moves[0][:, joint, :, 0], expected, atol=1e-11)


def test_no_offset_candidates_if_estimated_or_without_joints():
    """Robots given by poses, and those whose offsets are unknowns already, have no candidates."""
    assert list(of.candidates(views_of(Scenario(samples=6)))) == []
    estimated = Scenario(samples=12, joints=True, joint_offset_rad=1e-3, joint_offsets="prior")
    assert list(of.candidates(views_of(estimated))) == []


@pytest.mark.parametrize(
    ("rows", "reasons"),
    [
        ((0,), "the first joint moves the arm as its base does"),
        ((0, 2), "the first joint moves the arm as its base does, the samples hardly move the others alone"),
        ((0, 1), "joints 1 to 2 move the arm as its base does, in these samples"),
        ((0, 1, 2), "joints 1 to 3 move the arm as its base does, in these samples"),
        ((3,), "the last one as the mounts on its flange do"),
        ((2, 3), "the last one as the mounts on its flange do, the samples hardly move the others alone"),
        (
            (0, 1, 2, 3),
            "the first joint moves the arm as its base does, the last one as the mounts on its flange do, "
            "the samples hardly move the others alone",
        ),
    ],
)
def test_unobservable_joints_are_explained_by_position(rows, reasons):
    """Leading joints move the arm like its base, the last like its mounts; those between hardly move."""
    found = of.unobserved_reason(Unobserved("joints", rows, 4, "eye_base", False))
    assert found.split("joints: ", 1)[1].split(";")[0] == reasons


@pytest.mark.parametrize(
    ("largest", "sigma"), [(0.0, 0.005), (0.005, 0.005), (0.0051, 0.006), (0.03, 0.03), (0.031, 0.04), (0.91, 1.0)]
)
def test_suggested_sigma_covers_largest_offset(largest, sigma):
    """The suggested sigma is the largest absolute offset, rounded up to one digit, and at least 0.005."""
    assert of.suggested_sigma(np.array([0.0, -largest])) == pytest.approx(sigma)
    assert of.suggested_sigma(np.zeros(0)) == 0.005
