"""Tests of gravity torques and of masses read from a URDF."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3
from basecal.kinematics import Masses, SerialChain, gravity_torques, parse_chain
from basecal.simulation.arms import six_axis

DOWN = np.array([0.0, 0, -1])


def arm_with_gravity(down: np.ndarray) -> SerialChain:
    """The simulated arm with this direction of gravity."""
    chain = six_axis()
    return replace(chain, masses=replace(chain.masses, down=down))


def potential(chain: SerialChain, joints: np.ndarray, down: np.ndarray) -> np.ndarray:
    """The work of gravity on the arm, (...) [J]; its derivative by a joint is the torque."""
    frames = chain.joint_frames(joints)
    return sum(
        9.80665 * m * (frame @ c) @ down
        for m, c, frame in zip(chain.masses.kg, chain.masses.centres, frames, strict=True)
    )


@pytest.mark.parametrize("down", [DOWN, np.array([0.6, 0, -0.8])])
def test_torques_are_the_gradient_of_gravity_work(down):
    """Torques equal central differences, for an upright arm and one on an incline."""
    chain = arm_with_gravity(down)
    joints = np.random.default_rng(0).uniform(-3, 3, (20, 6))
    step = 1e-5
    wanted = [
        (potential(chain, joints + step * e, down) - potential(chain, joints - step * e, down)) / (2 * step)
        for e in np.eye(6)
    ]
    np.testing.assert_allclose(gravity_torques(chain, joints), np.stack(wanted, -1), atol=1e-7)


def test_torques_equal_pinocchio():
    """Torques of the same arm as a URDF are the negative of Pinocchio's holding torques."""
    pin = pytest.importorskip("pinocchio")
    chain = six_axis()
    model = pin.buildModelFromXML(chain_urdf(chain, "base_link", "tool0"))
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    for q in np.random.default_rng(1).uniform(-3, 3, (10, 6)):
        holding = pin.computeGeneralizedGravity(model, model.createData(), q)
        np.testing.assert_allclose(gravity_torques(chain, q), -holding, atol=1e-10)


def test_vertical_axis_has_no_torque():
    """The torque about a vertical first axis is exactly zero.

    From mere rounding, a compliance without bounds would be estimated.
    """
    joints = np.random.default_rng(2).uniform(-3, 3, (10, 6))
    assert not np.any(gravity_torques(six_axis(), joints)[:, 0])


def test_masses_of_links_carried_by_a_joint():
    """Links behind fixed joints and beside the chain count for the last turning joint above them.

    The base's mass does not count.
    """
    text = """<robot name="r"><link name="base"><inertial><mass value="9"/></inertial></link>
      <link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="2"/></inertial></link><link name="tool"/>
      <link name="gripper"><inertial><origin xyz="0 0 0.1"/><mass value="1"/></inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
      <joint name="hold" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.4 0 0"/></joint>
      <joint name="grip" type="prismatic"><parent link="tool"/><child link="gripper"/><origin xyz="0 0 0.1"/></joint>
    </robot>"""
    masses = parse_chain(text, "base", "tool").masses
    np.testing.assert_allclose(masses.kg, [3])
    np.testing.assert_allclose(masses.centres, [[0.6 / 3, 0, 0.2 / 3]], atol=1e-15)


@pytest.mark.parametrize(
    ("rpy", "down"),
    [("0 0 0.4", [0, 0, -1]), ("3.141592653589793 0 0", [0, 0, 1]), ("0 1.5707963267948966 0", [1, 0, 0])],
)
def test_gravity_direction_from_the_root_link(rpy, down):
    """The z axis of the root link points up. A joint between root and base is at its written pose."""
    text = f"""<robot name="r"><link name="hall"/><link name="rail"/><link name="base"/>
      <link name="arm"><inertial><mass value="2"/></inertial></link>
      <joint name="slide" type="prismatic"><parent link="hall"/><child link="rail"/><origin rpy="0 0 1"/></joint>
      <joint name="bolts" type="fixed"><parent link="rail"/><child link="base"/><origin rpy="{rpy}"/></joint>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"""
    np.testing.assert_allclose(parse_chain(text, "base", "arm").masses.down, down, atol=1e-15)


def test_masses_survive_a_urdf_round_trip():
    """Masses are written and read back, and a chain without masses has none."""
    chain = six_axis()
    again = parse_chain(chain_urdf(chain, "base_link", "tool0"), "base_link", "tool0").masses
    np.testing.assert_array_equal(again.kg, chain.masses.kg)
    np.testing.assert_allclose(again.centres, chain.masses.centres, atol=1e-15)
    bare = SerialChain(chain.joint_names, chain.origins, chain.axes, chain.tip, chain.lower, chain.upper)
    assert parse_chain(chain_urdf(bare, "base_link", "tool0"), "base_link", "tool0").masses is None
    with pytest.raises(InputError, match="inertial"):
        gravity_torques(bare, np.zeros(6))


@pytest.mark.parametrize(
    "inertial",
    [
        '<mass value="-1"/>',
        '<mass value="x"/>',
        '<mass value="nan"/>',
        '<mass value="1.1e6"/>',
        '<mass value="1 1"/>',
        '<origin xyz="0 0"/><mass value="1"/>',
        '<origin xyz="0 inf 0"/><mass value="1"/>',
        '<origin xyz="0 -1.1e6 0"/><mass value="1"/>',
        "",
    ],
)
def test_invalid_inertials_are_refused(inertial):
    """Unusable masses raise DatasetError with the link's name."""
    text = f"""<robot name="r"><link name="base"/><link name="arm"><inertial>{inertial}</inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>"""
    with pytest.raises(DatasetError, match="link 'arm' inertial"):
        parse_chain(text, "base", "arm")


def test_masses_match_their_chain():
    """A chain needs as many masses as joints, and masses are not negative."""
    origins = SE3.identity((1,))
    one = ("a",), origins, np.array([[0.0, 0, 1]]), SE3.identity(), np.array([-1.0]), np.array([1.0])
    with pytest.raises(InputError, match="masses of 2 joints"):
        SerialChain(*one, Masses(np.ones(2), np.zeros((2, 3))))
    with pytest.raises(InputError, match="not negative"):
        Masses(-np.ones(1), np.zeros((1, 3)))


def test_centres_of_light_and_massless_links():
    """A joint with less than a kilogram has the combined centre of its links, one without mass its own origin."""
    text = """<robot name="r"><link name="base"/>
      <link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="0.4"/></inertial></link>
      <link name="rod"><inertial><origin xyz="0 0 0.2"/><mass value="0"/></inertial></link>
      <link name="tool"><inertial><origin xyz="0.3 0.1 0"/><mass value="0.1"/></inertial></link>
      <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/></joint>
      <joint name="bend" type="continuous"><parent link="arm"/><child link="rod"/></joint>
      <joint name="hold" type="fixed"><parent link="arm"/><child link="tool"/></joint></robot>"""
    masses = parse_chain(text, "base", "rod").masses
    np.testing.assert_allclose(masses.kg, [0.5, 0.0])
    np.testing.assert_allclose(masses.centres, [[0.14, 0.02, 0], [0, 0, 0]], atol=1e-15)
    nothing = text.replace('value="0.4"', 'value="0"').replace('value="0.1"', 'value="0"')
    assert parse_chain(nothing, "base", "rod").masses is None


def test_gravity_points_down_by_default():
    """The default direction is -z, and a direction of any length is normalised."""
    chain = six_axis()
    assert chain.masses is not None
    parts = chain.masses.kg, chain.masses.centres
    np.testing.assert_array_equal(Masses(*parts).down, DOWN)
    np.testing.assert_allclose(Masses(*parts, np.array([0, 3.0, -4.0])).down, [0, 0.6, -0.8])
