"""Deflection: gravity's direction, and its fields in `calibration.json`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell import RobotParameters
from basecal.cell.robot_parameters import deflection as of
from basecal.errors import InputError
from basecal.kinematics import gravity_torques
from basecal.simulation.arms import six_axis

SEEN = np.ones(2, dtype=bool)
FOUND = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([False, True]))


def test_gravity_has_a_direction():
    """That of the chain unless stated otherwise, whether compliances are estimated or not."""
    chain = six_axis()
    assert of.hung(chain, of.Stated()) is of.hung(chain, None) is chain
    np.testing.assert_allclose(of.hung(chain, of.Stated(down=[0.0, 0.0, 3.0])).masses.down, [0, 0, 1])
    bare = replace(chain, masses=None)
    assert of.hung(bare, of.Stated(down=[0.0, 0.0, 3.0])) is bare
    with pytest.raises(ValidationError, match="not zero"):
        of.Stated(down=[0.0, 0.0, 0.0])


def test_joints_turn_by_the_torque_of_gravity():
    """Each by its own compliance, whatever the length of what states the direction."""
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    compliance = 1e-4 * np.arange(6.0)
    torques = gravity_torques(of.hung(six_axis(), of.Stated(down=[0.0, 1.0, 0.0])), joints)
    found = of.shift(six_axis(), of.Stated(down=[0.0, 7.0, 0.0]), joints, compliance)
    np.testing.assert_allclose(found, compliance * torques, rtol=1e-14)


def test_a_robot_needs_masses():
    """Without them there are no torques."""
    with pytest.raises(InputError, match="needs the masses of its links"):
        of.columns(replace(six_axis(), masses=None), of.Stated(status="free"))


def test_fields_of_the_calibration():
    """Each with its sigma and whether the data see it; read back alike, nothing being null."""
    (back,) = of.from_dict(of.to_dict({"arm": FOUND})).values()
    assert back.joints == ("a", "b")
    for name in ("values", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))
    assert of.to_dict({}) == {"deflection": None}
    assert of.from_dict({"deflection": None}) == {}


@pytest.mark.parametrize("key", ["rad_per_nm", "sigma_rad_per_nm"])
def test_numbers_of_other_shapes_are_refused(key):
    """As many numbers as joints."""
    entry = of.to_dict({"arm": FOUND})["deflection"]["arm"]
    with pytest.raises(InputError, match=f"{key} has shape"):
        of.from_dict({"deflection": {"arm": entry | {key: [1.0]}}})


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
    found = of.shift(six_axis(), of.Stated(), joints, values)
    one_by_one = [of.shift(six_axis(), of.Stated(), joints, value) for value in values]
    np.testing.assert_allclose(found, one_by_one, rtol=1e-14)


def test_down_is_by_any_one_axis():
    """A single component other than 0 is a direction, and three numbers as they are."""
    for down in ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]):
        np.testing.assert_array_equal(of.hung(six_axis(), of.Stated(down=down)).masses.down, down)
    assert of.Stated(down=None).down is None


@pytest.mark.parametrize(
    ("by_prior", "how"), [(True, "known from their prior alone"), (False, "that are unobservable")]
)
def test_why_compliances_are_not_seen(by_prior, how):
    assert of.unobserved("joint 1 (a)", [0], 6, "arm_base", by_prior) == (
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
