"""Tests of arms from MJCF files against MuJoCo's own kinematics."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

from basecal.errors import DatasetError, FrameNotFound, MissingExtra
from basecal.geometry import Array
from basecal.kinematics import SerialChain, read_chain
from basecal.kinematics.gravity import gravity_torques

mujoco = pytest.importorskip("mujoco", reason="pip install 'basecal[sim]'")

# Joints off the origins of their bodies, two in one body, reference angles, default classes, degrees.
ARM = """
<mujoco>
  <compiler angle="degree" meshdir="meshes"/>
  <default>
    <default class="arm"><joint axis="0 1 0" range="-170 170"/><geom mesh="shell" type="mesh"/></default>
  </default>
  <asset><mesh name="shell" file="shell.stl"/><material name="paint"/></asset>
  <worldbody>
    <body name="base" pos="0.3 0.1 0.2" euler="20 -30 40">
      <geom type="mesh" mesh="shell" material="paint"/>
      <body name="upper" pos="0 0 0.1" euler="10 20 30" childclass="arm">
        <inertial pos="0 0.01 0.2" mass="3" diaginertia="0.1 0.1 0.1"/>
        <joint name="swing" pos="0.02 0 0.01"/>
        <joint name="lift" axis="1 0 2" pos="0 0.03 0" ref="15"/>
        <body name="stiff" pos="0 0 0.4">
          <inertial pos="0 0 0.05" mass="1" diaginertia="0.1 0.1 0.1"/>
          <body name="lower" pos="0.05 0 0.1" quat="0.9 0.1 0.2 0.3">
            <inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.1 0.1"/>
            <joint name="elbow" limited="false"/>
            <site name="flange" pos="0.01 0.02 0.3" euler="0 90 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
ANGLES = np.radians([[0, 15, 0], [30, -40, 110], [-100, 60, -20]])


def chain_of(tmp_path, text: str, base: str = "base", flange: str = "flange") -> SerialChain:
    """The chain of an MJCF text."""
    path = tmp_path / "arm.xml"
    path.write_text(text, encoding="utf-8")
    return read_chain(path, base, flange)


def own_model():
    """The same model in MuJoCo, without its files."""
    return mujoco.MjModel.from_xml_string(
        re.sub(r"<geom type.*?/>|<geom mesh.*?/>|<asset>.*?</asset>", "", ARM, flags=re.DOTALL)
    )


def test_unnamed_joints_have_distinct_names(tmp_path) -> None:
    """Two joints of one body, and of unnamed bodies, are distinct in a table."""
    text = """<mujoco><worldbody><body name="base"><body name="a"><joint/><joint axis="1 0 0"/><geom size="1"/>
    <body><joint/><geom size="1"/><body><joint/><geom size="1"/><body name="flange"/></body></body></body></body>
    </worldbody></mujoco>"""
    assert chain_of(tmp_path, text).joint_names == ("a_joint", "a_joint_2", "_joint", "_joint_4")


def test_flange_poses_equal_mujoco(tmp_path) -> None:
    """The pose of the flange in the base is that of MuJoCo's kinematics at any joints."""
    chain, model = chain_of(tmp_path, ARM), own_model()
    data = mujoco.MjData(model)
    assert chain.joint_names == ("swing", "lift", "elbow")
    for angles in ANGLES:
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        base = data.body("base")
        turn = base.xmat.reshape(3, 3).T
        found = chain.forward(angles)
        np.testing.assert_allclose(found.translation, turn @ (data.site("flange").xpos - base.xpos), atol=1e-12)
        np.testing.assert_allclose(found.rotation, turn @ data.site("flange").xmat.reshape(3, 3), atol=1e-12)


def test_limits_and_masses(tmp_path) -> None:
    """Ranges are in radians, a joint without range is unlimited, and gravity torques equal MuJoCo's."""
    chain, model = chain_of(tmp_path, ARM), own_model()
    np.testing.assert_allclose(chain.upper, [np.radians(170), np.radians(170), np.inf])
    np.testing.assert_array_equal(chain.lower, -chain.upper)
    data = mujoco.MjData(model)
    data.qpos[:] = ANGLES[1]
    mujoco.mj_forward(model, data)
    ours: Array = gravity_torques(chain, ANGLES[1])
    # MuJoCo's bias is the torque that holds the arm, with a gravity of 9.81.
    np.testing.assert_allclose(ours * 9.81 / 9.80665, -data.qfrc_bias, atol=1e-9)


def test_masses_without_inertials_are_unknown(tmp_path) -> None:
    """An arm whose masses follow from shapes, which are not read, has no masses."""
    assert chain_of(tmp_path, re.sub(r"<inertial.*?/>", "", ARM)).masses is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<worldbody>", "<include file='other.xml'/><worldbody>"), "into one file"),
        (('<joint name="elbow" limited="false"/>', '<joint name="elbow" type="slide"/>'), "elbow"),
        (("<worldbody>", "<worldbody><body name='base'/>"), "cannot compile it"),
        (('<site name="flange"', '</body><body name="else"><site name="flange"'), None),
    ],
)
def test_invalid_arms_are_refused(tmp_path, change: tuple[str, str], message: str | None) -> None:
    """An arm with includes, a sliding joint, or no valid model is refused in one line.

    Bodies elsewhere are accepted.
    """
    text = ARM.replace(*change)
    if message is None:
        assert chain_of(tmp_path, text).joint_names == ("swing", "lift")
    else:
        with pytest.raises(DatasetError, match=message):
            chain_of(tmp_path, text)


def test_missing_names_are_refused(tmp_path) -> None:
    """The error for a missing body lists the existing ones.

    The flange has to be below the base, with joints between.
    """
    with pytest.raises(FrameNotFound, match="lower"):
        chain_of(tmp_path, ARM, base="bse")
    with pytest.raises(FrameNotFound, match="flange"):
        chain_of(tmp_path, ARM, flange="tool0")
    with pytest.raises(DatasetError, match="is not below"):
        chain_of(tmp_path, ARM, base="lower", flange="base")
    with pytest.raises(DatasetError, match="no hinge between"):
        chain_of(tmp_path, ARM, base="world", flange="base")


def test_missing_mujoco_raises_missing_extra(tmp_path, monkeypatch) -> None:
    """Without MuJoCo, the error names the extra to install."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtra, match="sim"):
        chain_of(tmp_path, ARM)


def test_unnamed_joint_is_named_by_its_body(tmp_path) -> None:
    """An unnamed joint has its body's name beside named ones, also in the error about a sliding joint."""
    bare = ARM.replace('<joint name="elbow" limited="false"/>', '<joint limited="false"/>')
    assert chain_of(tmp_path, bare).joint_names == ("swing", "lift", "lower_joint")
    with pytest.raises(DatasetError, match="lower_joint"):
        chain_of(tmp_path, bare.replace('<joint limited="false"/>', '<joint type="slide" limited="false"/>'))


LIGHT = """
<mujoco>
  <worldbody>
    <body name="first">
      <inertial pos="0.1 0 0" mass="0.5" diaginertia="0.1 0.1 0.1"/>
      <joint name="one" pos="0 0 0.2" axis="0 3 4"/>
      <body name="second" pos="0 0 0.4">
        <inertial pos="0 0.2 0" mass="{mass}" diaginertia="0.1 0.1 0.1"/>
        <joint name="two" axis="0 1 0"/>
        <body name="tool" pos="0.3 0 0"><inertial pos="0 0 0" mass="0.1" diaginertia="0.1 0.1 0.1"/></body>
      </body>
    </body>
    <body name="beside"><inertial pos="0 0 0" mass="7" diaginertia="0.1 0.1 0.1"/></body>
  </worldbody>
</mujoco>"""


def test_masses_of_bodies_carried_by_a_joint(tmp_path) -> None:
    """Bodies beside the chain count for the joint that carries them, from the world's first body on.

    Fixed bodies of the world do not count.
    """
    chain = chain_of(tmp_path, LIGHT.format(mass=0.3), "world", "second")
    assert chain.masses is not None
    np.testing.assert_allclose(chain.masses.kg, [0.5, 0.4])
    np.testing.assert_allclose(
        chain.masses.centres, [[0.1, 0, -0.2], [0.3 * 0.1 / 0.4, 0.2 * 0.3 / 0.4, 0]], atol=1e-12
    )
    np.testing.assert_allclose(chain.masses.down, [0, 0, -1])
    np.testing.assert_allclose(chain.axes, [[0, 0.6, 0.8], [0, 1, 0]], atol=1e-15)
    np.testing.assert_array_equal(chain.upper, [np.inf, np.inf])
