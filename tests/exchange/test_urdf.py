"""Tests that a corrected URDF is the calibrated robot, for this program and others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.errors import DatasetError, FrameNotFound, InputError
from basecal.exchange.urdf import RobotPart, chain_urdf, corrected_urdf, link_names, merged_urdf, patched_urdf
from basecal.geometry import SE3
from basecal.kinematics import Masses, SerialChain, parse_chain
from basecal.simulation.arms import six_axis

FOLDER = Path(__file__).parents[1] / "data" / "urdf"
ARMS = {"six_axis": ("base_link", "tool0"), "seven_axis": ("pedestal", "hand")}
ARM = (Path(__file__).parents[1] / "data" / "urdf" / "six_axis.urdf").read_bytes()
POSE = SE3.from_rpy([0.3, -0.7, 2.9], [0.81, -0.4, 0.05])
SCENE = b"""<robot name="scene">
  <link name="table"/><link name="left_mount"/><link name="left"/><link name="right_mount"/><link name="right"/>
  <link name="right_arm"/>
  <joint name="to_left" type="fixed"><parent link="table"/><child link="left_mount"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/></joint>
  <joint name="left_plate" type="fixed"><parent link="left_mount"/><child link="left"/>
    <origin xyz="0 0 0.02" rpy="0 0 0.5"/></joint>
  <!-- measured by hand -->
  <joint name="to_right" type="fixed"><parent link="table"/><child link="right_mount"/>
    <origin xyz="1 0 0"/></joint>
  <joint name="right_plate" type="fixed"><parent link="right_mount"/><child link="right"/></joint>
  <joint name="turn" type="revolute"><parent link="right"/><child link="right_arm"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def errors(chain: SerialChain, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return joint offsets of degrees, and links off by millimetres."""
    rng = np.random.default_rng(seed)
    return 0.02 * rng.standard_normal(chain.n), 3e-3 * rng.standard_normal((chain.n + 1, 6))


@pytest.fixture(params=ARMS)
def corrected_robot(request: pytest.FixtureRequest) -> tuple[str, tuple[str, str], SerialChain, np.ndarray, SE3]:
    """Return a corrected URDF, its ends, the original chain, joints, and the calibrated flange poses there."""
    ends, text = ARMS[request.param], (FOLDER / f"{request.param}.urdf").read_bytes()
    chain = parse_chain(text, *ends)
    offsets, links = errors(chain)
    joints = np.random.default_rng(1).uniform(-2, 2, (20, chain.n))
    wanted = chain.perturb_links(links).forward(joints + offsets)
    return corrected_urdf(text, *ends, offsets, links), ends, chain, joints, wanted


def test_corrected_urdf_reads_back_to_calibrated_robot(corrected_robot):
    """The flange matches to rounding; names, axes and limits are unchanged."""
    text, ends, chain, joints, wanted = corrected_robot
    again = parse_chain(text, *ends)
    np.testing.assert_allclose(again.forward(joints).matrix, wanted.matrix, atol=1e-13)
    assert again.joint_names == chain.joint_names
    np.testing.assert_array_equal(again.axes, chain.axes)
    np.testing.assert_array_equal([again.lower, again.upper], [chain.lower, chain.upper])


def test_pinocchio_agrees_with_corrected_urdf(corrected_robot):
    """Pinocchio's flange equals ours to 1e-9 m and rad."""
    pin = pytest.importorskip("pinocchio", reason="pin is not installed: pip install pin")
    text, (base, flange), chain, joints, wanted = corrected_robot
    model = pin.buildModelFromXML(text)
    data = model.createData()
    for q, pose in zip(joints, wanted.matrix, strict=True):
        whole = pin.neutral(model)
        for name, value in zip(chain.joint_names, q, strict=True):
            joint = model.joints[model.getJointId(name)]
            whole[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        pin.framesForwardKinematics(model, data, whole)
        frames = [data.oMf[model.getFrameId(name)] for name in (base, flange)]
        np.testing.assert_allclose((frames[0].inverse() * frames[1]).homogeneous, pose, atol=1e-9)


def test_mujoco_agrees_with_corrected_urdf(corrected_robot):
    """MuJoCo's flange equals ours to 1e-9 m and rad.

    MuJoCo must keep links without a mass; otherwise it fuses them into their parents, or refuses them.
    """
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install mujoco")
    text, (base, flange), chain, joints, wanted = corrected_robot
    options = '<mujoco><compiler fusestatic="false" boundmass="0.1" boundinertia="0.01"/></mujoco></robot>'
    model = mujoco.MjModel.from_xml_string(text.replace("</robot>", options))
    data = mujoco.MjData(model)
    for q, pose in zip(joints, wanted.matrix, strict=True):
        for name, value in zip(chain.joint_names, q, strict=True):
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        frames = [_of_body(data, mujoco, model, name) for name in (base, flange)]
        np.testing.assert_allclose(np.linalg.inv(frames[0]) @ frames[1], pose, atol=1e-9)


def _of_body(data, mujoco, model, name: str) -> np.ndarray:
    """Pose of a body; a root that MuJoCo made the world itself is at its origin."""
    matrix = np.eye(4)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) >= 0:
        matrix[:3, :3], matrix[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
    return matrix


def test_urdf_without_corrections_keeps_origins():
    """Without offsets every attribute is unchanged to the letter, as are comments inside."""
    text = (FOLDER / "six_axis.urdf").read_text(encoding="utf-8").replace("<link name=", "<!-- kept --><link name=", 1)
    again = corrected_urdf(text, "base_link", "tool0", np.zeros(6))
    origins = [line.strip().replace(" />", "/>") for line in text.splitlines() if "<origin" in line]
    assert [line.strip().replace(" />", "/>") for line in again.splitlines() if "<origin" in line] == origins
    assert "<!-- kept -->" in again


def test_rotation_near_90_degrees_pitch_is_exact():
    """If roll and yaw rotate about one axis, their product is still the rotation to 1e-14."""
    for tilt in (0.0, 1e-12, 1e-9, 1e-7, 1e-4):
        origin = f'<origin xyz="0 0 0" rpy="0.4 {np.pi / 2 - tilt!r} 0.3"/>'
        text = (
            f"<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
            f"<joint name='j' type='continuous'><parent link='a'/><child link='b'/>{origin}<axis xyz='1 0 0'/></joint>"
            "<joint name='k' type='fixed'><parent link='b'/><child link='c'/></joint></robot>"
        )
        chain = parse_chain(text, "a", "c")
        offset = np.array([0.01])
        again = parse_chain(corrected_urdf(text, "a", "c", offset), "a", "c")
        np.testing.assert_allclose(again.forward(np.zeros(1)).matrix, chain.forward(offset).matrix, atol=1e-14)


def test_tip_error_on_moving_joint_is_refused():
    """A chain that ends at a moving joint has no origin for the tip's error; its offsets are written nevertheless."""
    text = chain_urdf(six_axis(), "base_link", "tool0")
    offsets, links = errors(six_axis())
    with pytest.raises(InputError, match=r"'wrist_3' above .* is not fixed"):
        corrected_urdf(text, "base_link", "wrist_3_link", offsets, links)
    assert "<origin" in corrected_urdf(text, "base_link", "wrist_3_link", offsets)


def test_chain_urdf_round_trip():
    """A chain written as URDF is the same again, with limits and for joints without any."""
    chain = six_axis()
    endless = SerialChain(
        chain.joint_names, chain.origins, chain.axes, chain.tip, np.full(6, -np.inf), np.full(6, np.inf)
    )
    joints = np.random.default_rng(2).uniform(-3, 3, (10, 6))
    for arm in (chain, endless):
        again = parse_chain(chain_urdf(arm, "base_link", "tool0"), "base_link", "tool0")
        np.testing.assert_allclose(again.forward(joints).matrix, arm.forward(joints).matrix, atol=1e-14)
        np.testing.assert_array_equal([again.lower, again.upper], [arm.lower, arm.upper])


def test_chain_urdf_keeps_masses():
    """Each link keeps its mass and centre to rounding."""
    rng = np.random.default_rng(2)
    chain = six_axis()
    chain = replace(chain, masses=Masses(rng.uniform(1, 5, chain.n), rng.normal(0, 0.1, (chain.n, 3))))
    again = parse_chain(chain_urdf(chain, "base_link", "tool0"), "base_link", "tool0").masses
    assert again is not None
    np.testing.assert_allclose(again.kg, chain.masses.kg)
    np.testing.assert_allclose(again.centres, chain.masses.centres, atol=1e-12)


def between(text: str, parent: str, child: str):
    """Return `parent_from_child` of two links at zero joints, by Pinocchio."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    first, second = (data.oMf[model.getFrameId(link)].homogeneous for link in (parent, child))
    return np.linalg.inv(first) @ second


@pytest.mark.parametrize("joint", ["to_left", "left_plate", "to_right", "right_plate"])
def test_patching_one_joint_places_link(joint):
    """Any fixed joint between both links may be changed, on either side; the others are unchanged."""
    text = patched_urdf(SCENE, "left", "right", POSE, joint=joint, remarks=("from -- a run",))
    np.testing.assert_allclose(between(text, "left", "right"), POSE.matrix, atol=1e-12)
    ends = {"to_left": "table left_mount", "left_plate": "left_mount left", "to_right": "table right_mount"}
    for other, links in ends.items():
        if other != joint:
            before = between(SCENE.decode(), *links.split())
            np.testing.assert_allclose(between(text, *links.split()), before, atol=1e-15)
    assert "<!-- measured by hand -->" in text
    assert "<!-- from - - a run -->" in text


def test_single_joint_needs_no_name():
    """The only joint between a link and its parent is found in either direction."""
    text = patched_urdf(SCENE, "table", "left_mount", POSE)
    np.testing.assert_allclose(between(text, "table", "left_mount"), POSE.matrix, atol=1e-12)
    turned_round = patched_urdf(SCENE, "left_mount", "table", POSE)
    np.testing.assert_allclose(between(turned_round, "left_mount", "table"), POSE.matrix, atol=1e-12)


def test_impossible_patches_are_refused():
    """An unknown link, an unknown joint, several joints, a moving joint, and invalid XML are errors."""
    with pytest.raises(FrameNotFound, match="no 'lift'"):
        patched_urdf(SCENE, "lift", "right", POSE)
    with pytest.raises(FrameNotFound, match="no 'turn'"):
        patched_urdf(SCENE, "left", "right", POSE, joint="turn")
    with pytest.raises(InputError, match=r"are 4 joints between .*; choose one with --joint"):
        patched_urdf(SCENE, "left", "right", POSE)
    with pytest.raises(InputError, match="'turn' between 'left' and 'right_arm' is not fixed"):
        patched_urdf(SCENE, "left", "right_arm", POSE, joint="to_right")
    with pytest.raises(InputError, match="are 0 joints"):
        patched_urdf(SCENE, "left", "left", POSE)
    with pytest.raises(DatasetError, match=r"a\.urdf"):
        patched_urdf(b"<robot", "left", "right", POSE, path="a.urdf")


def parts(base_link: str = "base_link"):
    return {"eye": RobotPart(ARM, base_link, "eye.urdf"), "hand": RobotPart(ARM, base_link, "hand.urdf")}


def test_merged_robots_have_calibrated_bases():
    """Their bases have the given pose even if they are not the roots of their URDFs.

    Each robot keeps its own joints.
    """
    text = merged_urdf(parts(), "eye", {"hand": POSE}, ("made by",))
    np.testing.assert_allclose(between(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)
    model, alone = pinocchio.buildModelFromXML(text), pinocchio.buildModelFromXML(ARM.decode())
    assert model.nq == 2 * alone.nq
    assert {f"eye_{name}" for name in alone.names[1:]} | {f"hand_{name}" for name in alone.names[1:]} == set(
        model.names[1:]
    )
    np.testing.assert_allclose(
        between(text, "hand_base_link", "hand_tool0"), between(ARM.decode(), "base_link", "tool0"), atol=1e-12
    )


def test_references_are_renamed_in_merged_urdf():
    """A joint that mimics another mimics that of its own robot."""
    mimic = b"""<robot name="r"><link name="a"/><link name="b"/><link name="c"/><material name="red"/>
      <joint name="one" type="continuous"><parent link="a"/><child link="b"/></joint>
      <joint name="two" type="continuous"><parent link="a"/><child link="c"/><mimic joint="one"/></joint>
      <gazebo reference="b"/><gazebo/></robot>"""
    text = merged_urdf({"eye": RobotPart(mimic, "a", "a")}, "eye", {})
    for part in ('<mimic joint="eye_one"', '<gazebo reference="eye_b"', '<material name="eye_red"', "<gazebo />"):
        assert part in text


def test_impossible_merges_are_refused():
    """A base above a moving joint, and an unknown base, are errors."""
    with pytest.raises(InputError, match=r"eye\.urdf: joint 'shoulder_pan' above 'shoulder' is not fixed"):
        merged_urdf(parts("shoulder"), "eye", {"hand": POSE})
    with pytest.raises(FrameNotFound, match="no 'bass_link'"):
        merged_urdf(parts("bass_link"), "eye", {"hand": POSE})


def test_links_are_listed_in_file_order():
    """Link names have the order of the file."""
    assert link_names(SCENE)[:2] == ["table", "left_mount"]
