"""Deflection: gravity's direction, and its fields in `calibration.json`."""

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


def test_gravity_has_a_direction():
    """That of the chain unless stated otherwise, whether compliances are estimated or not."""
    chain = six_axis()
    assert of.apply_gravity(chain, of.Stated()) is of.apply_gravity(chain, None) is chain
    np.testing.assert_allclose(of.apply_gravity(chain, of.Stated(down=[0.0, 0.0, 3.0])).masses.down, [0, 0, 1])
    bare = replace(chain, masses=None)
    assert of.apply_gravity(bare, of.Stated(down=[0.0, 0.0, 3.0])) is bare
    with pytest.raises(ValidationError, match="not zero"):
        of.Stated(down=[0.0, 0.0, 0.0])


def test_joints_turn_by_the_torque_of_gravity():
    """Each by its own compliance, whatever the length of what states the direction."""
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


def test_a_robot_needs_masses():
    """Without them there are no torques."""
    with pytest.raises(InputError, match="needs the masses of its links"):
        of.columns(replace(six_axis(), masses=None), of.Stated(status="free"))


def test_fields_of_the_calibration():
    """Each with its sigma and whether the data see it; read back alike, nothing being null."""
    (back,) = of.EFFECT.parameter.from_dict(of.EFFECT.parameter.to_dict({"arm": FOUND})).values()
    assert back.joints == ("a", "b")
    for name in ("values", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))
    assert of.EFFECT.parameter.to_dict({}) == {"deflection": None}
    assert of.EFFECT.parameter.from_dict({"deflection": None}) == {}


@pytest.mark.parametrize("key", ["rad_per_nm", "sigma_rad_per_nm"])
def test_numbers_of_other_shapes_are_refused(key):
    """As many numbers as joints."""
    entry = of.EFFECT.parameter.to_dict({"arm": FOUND})["deflection"]["arm"]
    with pytest.raises(InputError, match=f"{key} has shape"):
        of.EFFECT.parameter.from_dict({"deflection": {"arm": entry | {key: [1.0]}}})


@pytest.mark.parametrize(("stated", "sigma"), [({"status": "free"}, None), ({"sigma_rad_per_nm": 2e-5}, [2e-5] * 6)])
def test_a_column_a_joint(stated, sigma):
    """In rad/Nm, with the prior's sigma where there is one."""
    columns = of.columns(six_axis(), of.Stated(**{"status": "prior", **stated}))
    np.testing.assert_array_equal(columns.basis, np.eye(6))
    assert (columns.sigma if sigma is None else columns.sigma.tolist()) == sigma


def test_a_batch_of_compliances_goes_over_all_joints():
    """Each of a batch at every row of joints, as one by one."""
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    values = 1e-4 * np.random.default_rng(1).standard_normal((3, 6))
    found = of.EFFECT.parameter.shift(six_axis(), of.Stated(), joints, values)
    one_by_one = [of.EFFECT.parameter.shift(six_axis(), of.Stated(), joints, value) for value in values]
    np.testing.assert_allclose(found, one_by_one, rtol=1e-14)


def test_down_is_by_any_one_axis():
    """A single component other than 0 is a direction, and three numbers as they are."""
    for down in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]):
        np.testing.assert_array_equal(of.apply_gravity(six_axis(), of.Stated(down=down)).masses.down, down)
    assert of.Stated(down=None).down is None


@pytest.mark.parametrize(
    ("by_prior", "how"), [(True, "known from their prior alone"), (False, "that are unobservable")]
)
def test_why_compliances_are_not_seen(by_prior, how):
    assert of.unobserved_reason(Unobserved("joint 1 (a)", (0,), 6, "arm_base", by_prior)) == (
        f"compliances {how}: joint 1 (a): the torque of gravity about them is small in these samples, or the same in "
        "all of them"
    )


def test_compliances_are_told_in_microradians():
    heading, *lines = of.report("arm", RobotParameters(("a", "b"), np.array([1e-4, -2e-6]), np.full(2, 3e-7), SEEN))
    assert heading == "compliances of the joints of arm under the torque of gravity"
    assert [line.split()[2:6] for line in lines] == [
        ["+100.00", "urad/Nm", "sigma", "0.30"],
        ["-2.00", "urad/Nm", "sigma", "0.30"],
    ]


def errors(problem, robot):
    """The errors that a robot's stops share by the weight of its links."""
    return shared_errors(of.EFFECT.random, problem, robot)


def test_what_joints_share_moves_the_flange_as_one_compliance_does():
    """The first error is that of all joints yielding alike, by a radian where most torque is on one of them."""
    problem = simulated_problem(SCENARIO)
    at = posture_at_stops(problem, "eye")
    torques = gravity_torques(at.chain, at.recorded)
    most = np.sqrt(np.mean(torques**2, axis=0)).max()
    off = Kinematics(at.chain, {"deflection": np.full(6, 1e-6 / most)}).forward(at.recorded)
    moved = (at.chain.forward(at.recorded).inverse() @ off).log()
    np.testing.assert_allclose(of.shared_errors(at).by_stop[:, :, 0] * 1e-6, np.sqrt(0.7) * moved, atol=1e-10)


def test_an_arm_on_the_ceiling_yields_the_other_way():
    """By what the cell states of gravity, though compliances are not estimated."""
    simulated = simulate(SCENARIO, 2)
    eye = replace(simulated.cell.robots["eye"], parameters={"deflection": of.Stated(down=[0.0, 0.0, 1.0])})
    cell = replace(simulated.cell, robots={**simulated.cell.robots, "eye": eye})
    hanging, upright = build_problem(cell, simulated.recording)[0], simulated_problem(SCENARIO)
    assert not hanging.models
    np.testing.assert_allclose(errors(hanging, "eye").by_stop, -errors(upright, "eye").by_stop, atol=1e-15)
    np.testing.assert_array_equal(errors(hanging, "hand").by_stop, errors(upright, "hand").by_stop)


def test_arms_without_masses_and_estimated_compliances_have_none():
    """Nothing says what their joints carry, or it is told already."""
    problem = simulated_problem(SCENARIO)
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    assert errors(replace(problem, chains=light), "eye") is None
    assert errors(simulated_problem(replace(SCENARIO, compliance=1e-5, deflection="prior")), "eye") is None


def test_each_error_is_a_turn():
    """That of all joints together, then one of each joint: all of them turn."""
    found = errors(simulated_problem(SCENARIO), "eye")
    assert found.by_stop.shape[-1] == 7
    np.testing.assert_array_equal(found.is_turn, [True] * 7)


def test_joints_yield_to_their_torques():
    """A unit of each compliance moves the view as a joint that turns by its torque; one for all is their sum."""
    views = views_of(Scenario(samples=6, joints=True))
    problem = views.problem
    alike, each = (c.moves[0][:, 0] for c in of.candidates(views) if c.about == ("hand",))
    kinematics = Kinematics(problem.chains["hand"], {"deflection": 1e-8 * np.arange(1.0, 7.0)})
    moved = kinematics.forward(problem.groups[0].hand.joints)
    np.testing.assert_allclose(1e-8 * each @ np.arange(1.0, 7.0), moved_by_pose(views, "hand", moved), atol=1e-10)
    np.testing.assert_allclose(alike[..., 0], each.sum(-1))


def test_compliances_that_are_estimated_or_of_no_masses_are_not_tested():
    """Nor those of robots given by poses."""
    assert list(of.candidates(views_of(Scenario(samples=6)))) == []
    estimated = views_of(Scenario(samples=12, joints=True, compliance=1e-5, deflection="prior"))
    assert list(of.candidates(estimated)) == []
    light = {name: replace(chain, masses=None) for name, chain in estimated.problem.chains.items()}
    light_arms = replace(estimated.problem, chains=light, models={})
    assert list(of.candidates(replace(estimated, problem=light_arms, recorded=light_arms))) == []


def test_what_joints_share_is_mostly_equal():
    """Of a variance seven tenths are that of all joints, and three those of each by itself, as it is loaded."""
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
