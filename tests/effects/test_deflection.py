"""Tests of deflection: gravity's direction, and its fields in `calibration.json`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell import RobotParameters
from basecal.effects import deflection as of
from basecal.effects.faces.robot_parameter import Unobserved
from basecal.errors import InputError
from basecal.estimation.noise.random_effects import posture_at_stops, shared_errors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.kinematics import gravity_torques
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import six_axis
from made_views import moved_by_pose, views_of
from simulated_problem import simulated_problem

SCENARIO = Scenario(samples=8, joints=True)
SEEN = np.ones(2, dtype=bool)
FOUND = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([False, True]))


def test_gravity_direction_defaults_to_chains():
    """The chain's direction of gravity applies unless another is stated, whether compliances are estimated or not."""
    chain = six_axis()
    assert of.apply_gravity(chain, of.Stated()) is of.apply_gravity(chain, None) is chain
    np.testing.assert_allclose(of.apply_gravity(chain, of.Stated(down=[0.0, 0.0, 3.0])).masses.down, [0, 0, 1])
    bare = replace(chain, masses=None)
    assert of.apply_gravity(bare, of.Stated(down=[0.0, 0.0, 3.0])) is bare
    with pytest.raises(ValidationError, match="not zero"):
        of.Stated(down=[0.0, 0.0, 0.0])


def test_joints_rotate_by_gravity_torque():
    """Each joint rotates by its own compliance, whatever the length of the stated direction."""
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    compliance = 1e-4 * np.arange(6.0)
    torques = gravity_torques(of.apply_gravity(six_axis(), of.Stated(down=[0.0, 1.0, 0.0])), joints)
    found = of.EFFECT.parameter.shift(six_axis(), of.Stated(down=[0.0, 7.0, 0.0]), joints, compliance)
    np.testing.assert_allclose(found, compliance * torques, rtol=1e-14)
    one = of.EFFECT.parameter.shift(six_axis(), of.Stated(down=[0.0, 7.0, 0.0]), joints[2], compliance)
    np.testing.assert_allclose(one, found[2], rtol=1e-14)
    many = of.EFFECT.parameter.shift(
        six_axis(), of.Stated(down=[0.0, 7.0, 0.0]), joints, np.stack([compliance, 2 * compliance])
    )
    np.testing.assert_allclose(many, np.stack([found, 2 * found]), rtol=1e-14)


def test_deflection_needs_link_masses():
    """Without the masses of the links there are no torques."""
    with pytest.raises(InputError, match="needs the masses of its links"):
        of.columns(replace(six_axis(), masses=None), of.Stated(status="free"))


def test_deflection_round_trip():
    """Compliances are written with their sigmas and observability and read back; without any the field is null."""
    (back,) = of.EFFECT.parameter.from_dict(of.EFFECT.parameter.to_dict({"arm": FOUND})).values()
    assert back.joints == ("a", "b")
    for name in ("values", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))
    assert of.EFFECT.parameter.to_dict({}) == {"deflection": None}
    assert of.EFFECT.parameter.from_dict({"deflection": None}) == {}


@pytest.mark.parametrize("key", ["rad_per_nm", "sigma_rad_per_nm"])
def test_wrong_number_of_compliances_is_refused(key):
    """Each joint needs exactly one compliance."""
    entry = of.EFFECT.parameter.to_dict({"arm": FOUND})["deflection"]["arm"]
    with pytest.raises(InputError, match=f"{key} has shape"):
        of.EFFECT.parameter.from_dict({"deflection": {"arm": entry | {key: [1.0]}}})


@pytest.mark.parametrize(("stated", "sigma"), [({"status": "free"}, None), ({"sigma_rad_per_nm": 2e-5}, [2e-5] * 6)])
def test_one_compliance_column_per_joint(stated, sigma):
    """A compliance is in rad/Nm, with the prior's sigma if there is one."""
    columns = of.columns(six_axis(), of.Stated(**{"status": "prior", **stated}))
    np.testing.assert_array_equal(columns.basis, np.eye(6))
    assert (columns.sigma if sigma is None else columns.sigma.tolist()) == sigma


def test_batch_of_compliances_equals_single_evaluations():
    """A batch is applied to every row of joints, equal to one evaluation for each."""
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    values = 1e-4 * np.random.default_rng(1).standard_normal((3, 6))
    found = of.EFFECT.parameter.shift(six_axis(), of.Stated(), joints, values)
    one_by_one = [of.EFFECT.parameter.shift(six_axis(), of.Stated(), joints, value) for value in values]
    np.testing.assert_allclose(found, one_by_one, rtol=1e-14)


def test_gravity_direction_needs_one_non_zero_component():
    """A direction along one axis, with a single nonzero component, is accepted and used as stated."""
    for down in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]):
        np.testing.assert_array_equal(of.apply_gravity(six_axis(), of.Stated(down=down)).masses.down, down)
    assert of.Stated(down=None).down is None


@pytest.mark.parametrize(
    ("by_prior", "how"), [(True, "known from their prior alone"), (False, "that are unobservable")]
)
def test_unobservable_compliances_are_explained(by_prior, how):
    """The reason states that the torque of gravity is small or constant, and whether a prior determines the value."""
    assert of.unobserved_reason(Unobserved("joint 1 (a)", (0,), 6, "arm_base", by_prior)) == (
        f"compliances {how}: joint 1 (a): the torque of gravity about them is small in these samples, or the same in "
        "all of them"
    )


def test_compliances_are_reported_in_microradians():
    """The report gives each compliance and its sigma in urad/Nm."""
    heading, *lines = of.report("arm", RobotParameters(("a", "b"), np.array([1e-4, -2e-6]), np.full(2, 3e-7), SEEN))
    assert heading == "compliances of the joints of arm under the torque of gravity"
    assert [line.split()[2:6] for line in lines] == [
        ["+100.00", "urad/Nm", "sigma", "0.30"],
        ["-2.00", "urad/Nm", "sigma", "0.30"],
    ]


def errors(problem, robot):
    """Return the errors that a robot's stops share through the weight of its links."""
    return shared_errors(of.EFFECT.random, problem, robot)


def test_shared_compliance_moves_flange():
    """The first error is that of all joints yielding equally, scaled to a radian for the highest joint torque."""
    problem = simulated_problem(SCENARIO)
    at = posture_at_stops(problem, "eye")
    torques = gravity_torques(at.chain, at.recorded)
    most = np.sqrt(np.mean(torques**2, axis=0)).max()
    off = Kinematics(at.chain, {"deflection": np.full(6, 1e-6 / most)}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(of.shared_errors(at).by_stop[:, :, 0] * 1e-6, np.sqrt(0.7) * moved, atol=1e-10)


def test_inverted_arm_deflects_oppositely():
    """The stated direction of gravity applies to a ceiling-mounted arm even if compliances are not estimated."""
    simulated = simulate(SCENARIO, 2)
    eye = replace(simulated.cell.robots["eye"], parameters={"deflection": of.Stated(down=[0.0, 0.0, 1.0])})
    cell = replace(simulated.cell, robots={**simulated.cell.robots, "eye": eye})
    hanging, upright = build_problem(cell, simulated.recording)[0], simulated_problem(SCENARIO)
    assert not hanging.models
    np.testing.assert_allclose(errors(hanging, "eye").by_stop, -errors(upright, "eye").by_stop, atol=1e-15)
    np.testing.assert_array_equal(errors(hanging, "hand").by_stop, errors(upright, "hand").by_stop)


def test_no_deflection_effect_without_masses_or_if_estimated():
    """Without masses the loads are unknown; estimated compliances replace the random effect."""
    problem = simulated_problem(SCENARIO)
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    assert errors(replace(problem, chains=light), "eye") is None
    assert errors(simulated_problem(replace(SCENARIO, compliance=1e-5, deflection="prior")), "eye") is None


def test_each_deflection_error_is_a_rotation():
    """One error is that of all joints together, then one of each joint; all are rotations."""
    found = errors(simulated_problem(SCENARIO), "eye")
    assert found.by_stop.shape[-1] == 7
    np.testing.assert_array_equal(found.is_turn, [True] * 7)


def test_candidate_compliances_follow_torques():
    """One unit of a compliance moves the view like a joint rotated by its torque.

    The candidate for all joints is the sum of theirs.
    """
    views = views_of(Scenario(samples=6, joints=True))
    problem = views.problem
    alike, each = (c.moves[0][:, 0] for c in of.candidates(views) if c.about == ("hand",))
    kinematics = Kinematics(problem.chains["hand"], {"deflection": 1e-8 * np.arange(1.0, 7.0)})
    moved = kinematics.forward(problem.groups[0].hand.joints)
    np.testing.assert_allclose(1e-8 * each @ np.arange(1.0, 7.0), moved_by_pose(views, "hand", moved), atol=1e-10)
    np.testing.assert_allclose(alike[..., 0], each.sum(-1))


def test_no_compliance_candidates_if_estimated_or_massless():
    """Estimated compliances, arms without masses, and robots given by poses have no candidates."""
    assert list(of.candidates(views_of(Scenario(samples=6)))) == []
    estimated = views_of(Scenario(samples=12, joints=True, compliance=1e-5, deflection="prior"))
    assert list(of.candidates(estimated)) == []
    light = {name: replace(chain, masses=None) for name, chain in estimated.problem.chains.items()}
    light_arms = replace(estimated.problem, chains=light, models={})
    assert list(of.candidates(replace(estimated, problem=light_arms, recorded=light_arms))) == []


def test_shared_compliance_has_most_of_variance():
    """Seven tenths of the variance are shared by all joints and three tenths are each joint's own, by its load."""
    at = posture_at_stops(simulated_problem(SCENARIO), "eye")
    shared = of.shared_errors(at)
    together, each = shared.by_stop[..., 0], shared.by_stop[..., 1:]
    assert shared.is_turn.tolist() == [True] * 7
    np.testing.assert_allclose(together / np.sqrt(0.7), each.sum(-1) / np.sqrt(0.3), atol=1e-12)
    torques = gravity_torques(at.chain, at.recorded)
    most = np.sqrt(np.mean(torques**2, axis=0)).max()
    np.testing.assert_allclose(
        each[..., 1], np.sqrt(0.3) * at.true.joint_derivative[..., 1] * torques[:, 1:2] / most, atol=1e-12
    )
