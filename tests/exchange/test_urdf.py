"""A corrected URDF is the calibrated robot, for us and for other programs that read it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange.urdf import chain_urdf, corrected_urdf
from basecal.geometry import SE3
from basecal.kinematics import Masses, SerialChain, parse_chain
from basecal.simulation.arms import six_axis

FOLDER = Path(__file__).parents[1] / "data" / "urdf"
ARMS = {"six_axis": ("base_link", "tool0"), "seven_axis": ("pedestal", "hand")}


def errors(chain: SerialChain, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Offsets of degrees, links off by millimetres."""
    rng = np.random.default_rng(seed)
    return 0.02 * rng.standard_normal(chain.n), 3e-3 * rng.standard_normal((chain.n + 1, 6))


@pytest.fixture(params=ARMS)
def corrected(request: pytest.FixtureRequest) -> tuple[str, tuple[str, str], SerialChain, np.ndarray, SE3]:
    """A corrected URDF, its ends, the chain as it was; joints, and where the calibrated flange is at them."""
    ends, text = ARMS[request.param], (FOLDER / f"{request.param}.urdf").read_bytes()
    chain = parse_chain(text, *ends)
    offsets, links = errors(chain)
    joints = np.random.default_rng(1).uniform(-2, 2, (20, chain.n))
    wanted = chain.perturb_links(links).forward(joints + offsets)
    return corrected_urdf(text, *ends, offsets, links), ends, chain, joints, wanted


def test_it_reads_back_to_the_calibrated_robot(corrected):
    """To rounding; names, axes and limits are as they were."""
    text, ends, chain, joints, wanted = corrected
    again = parse_chain(text, *ends)
    np.testing.assert_allclose(again.forward(joints).matrix, wanted.matrix, atol=1e-13)
    assert again.joint_names == chain.joint_names
    np.testing.assert_array_equal(again.axes, chain.axes)
    np.testing.assert_array_equal([again.lower, again.upper], [chain.lower, chain.upper])


def test_pinocchio_reads_the_calibrated_robot(corrected):
    """Its flange is ours to 1e-9 m and rad."""
    pin = pytest.importorskip("pinocchio", reason="pin is not installed: pip install pin")
    text, (base, flange), chain, joints, wanted = corrected
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


def test_mujoco_reads_the_calibrated_robot(corrected):
    """Its flange is ours to 1e-9 m and rad.

    MuJoCo is told to keep links without a mass: it melts them into their parents, or refuses them, otherwise.
    """
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install mujoco")
    text, (base, flange), chain, joints, wanted = corrected
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
    """Pose of a body; a root that MuJoCo has made the world itself stands at its origin."""
    matrix = np.eye(4)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) >= 0:
        matrix[:3, :3], matrix[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
    return matrix


def test_nothing_to_correct_changes_no_origin():
    """Without offsets every attribute stays to the letter, comments inside too."""
    text = (FOLDER / "six_axis.urdf").read_text(encoding="utf-8").replace("<link name=", "<!-- kept --><link name=", 1)
    again = corrected_urdf(text, "base_link", "tool0", np.zeros(6))
    origins = [line.strip().replace(" />", "/>") for line in text.splitlines() if "<origin" in line]
    assert [line.strip().replace(" />", "/>") for line in again.splitlines() if "<origin" in line] == origins
    assert "<!-- kept -->" in again


def test_a_turn_near_a_pitch_of_90_degrees_is_exact():
    """Where roll and yaw turn about one axis, their product still is the rotation to 1e-14."""
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


def test_a_tip_that_cannot_be_written_is_said():
    """A chain that ends at a turning joint has no origin for the tip's error; its offsets are written all the same."""
    text = chain_urdf(six_axis(), "base_link", "tool0")
    offsets, links = errors(six_axis())
    with pytest.raises(InputError, match="turning joint 'wrist_3'"):
        corrected_urdf(text, "base_link", "wrist_3_link", offsets, links)
    assert "<origin" in corrected_urdf(text, "base_link", "wrist_3_link", offsets)


def test_a_chain_written_as_urdf_is_the_same():
    """Limits too, and joints that have none."""
    chain = six_axis()
    endless = SerialChain(
        chain.joint_names, chain.origins, chain.axes, chain.tip, np.full(6, -np.inf), np.full(6, np.inf)
    )
    joints = np.random.default_rng(2).uniform(-3, 3, (10, 6))
    for arm in (chain, endless):
        again = parse_chain(chain_urdf(arm, "base_link", "tool0"), "base_link", "tool0")
        np.testing.assert_allclose(again.forward(joints).matrix, arm.forward(joints).matrix, atol=1e-14)
        np.testing.assert_array_equal([again.lower, again.upper], [arm.lower, arm.upper])


def test_a_written_chain_keeps_its_masses():
    """Each link has its own mass and centre, read back to rounding."""
    rng = np.random.default_rng(2)
    chain = six_axis()
    chain = replace(chain, masses=Masses(rng.uniform(1, 5, chain.n), rng.normal(0, 0.1, (chain.n, 3))))
    again = parse_chain(chain_urdf(chain, "base_link", "tool0"), "base_link", "tool0").masses
    assert again is not None
    np.testing.assert_allclose(again.kg, chain.masses.kg)
    np.testing.assert_allclose(again.centres, chain.masses.centres, atol=1e-12)
