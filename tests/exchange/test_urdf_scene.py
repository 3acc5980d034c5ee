"""URDFs that say where robots stand, as Pinocchio reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.errors import DatasetError, FrameNotFound, InputError
from basecal.exchange.urdf_scene import RobotPart, link_names, merged_urdf, patched_urdf
from basecal.geometry import SE3

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


def between(text: str, parent: str, child: str):
    """`parent_from_child` of two links, joints at zero, by Pinocchio."""
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    first, second = (data.oMf[model.getFrameId(link)].homogeneous for link in (parent, child))
    return np.linalg.inv(first) @ second


@pytest.mark.parametrize("joint", ["to_left", "left_plate", "to_right", "right_plate"])
def test_one_origin_puts_a_link_where_it_is_to_stand(joint):
    """Whichever of the fixed joints between both is moved, on either side; the others stay."""
    text = patched_urdf(SCENE, "left", "right", POSE, joint=joint, remarks=("from -- a run",))
    np.testing.assert_allclose(between(text, "left", "right"), POSE.matrix, atol=1e-12)
    ends = {"to_left": "table left_mount", "left_plate": "left_mount left", "to_right": "table right_mount"}
    for other, links in ends.items():
        if other != joint:
            before = between(SCENE.decode(), *links.split())
            np.testing.assert_allclose(between(text, *links.split()), before, atol=1e-15)
    assert "<!-- measured by hand -->" in text
    assert "<!-- from - - a run -->" in text


def test_the_only_joint_needs_no_name():
    """Between a link and the one it hangs on."""
    text = patched_urdf(SCENE, "table", "left_mount", POSE)
    np.testing.assert_allclose(between(text, "table", "left_mount"), POSE.matrix, atol=1e-12)
    turned_round = patched_urdf(SCENE, "left_mount", "table", POSE)
    np.testing.assert_allclose(between(turned_round, "left_mount", "table"), POSE.matrix, atol=1e-12)


def test_what_cannot_be_patched_is_said():
    """No such link, no such joint between both, several, one that turns, and no URDF."""
    with pytest.raises(FrameNotFound, match="no 'lift'"):
        patched_urdf(SCENE, "lift", "right", POSE)
    with pytest.raises(FrameNotFound, match="no 'turn'"):
        patched_urdf(SCENE, "left", "right", POSE, joint="turn")
    with pytest.raises(InputError, match="are 4 joints; say whose origin, with --joint"):
        patched_urdf(SCENE, "left", "right", POSE)
    with pytest.raises(InputError, match="'turn' between 'left' and 'right_arm' is not fixed"):
        patched_urdf(SCENE, "left", "right_arm", POSE, joint="to_right")
    with pytest.raises(InputError, match="are 0 joints"):
        patched_urdf(SCENE, "left", "left", POSE)
    with pytest.raises(DatasetError, match=r"a\.urdf"):
        patched_urdf(b"<robot", "left", "right", POSE, path="a.urdf")


def parts(base_link: str = "base_link"):
    return {"eye": RobotPart(ARM, base_link, "eye.urdf"), "hand": RobotPart(ARM, base_link, "hand.urdf")}


def test_two_robots_stand_where_they_were_found():
    """Their bases, though these are not the roots of their URDFs; each moves with its own joints."""
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


def test_names_that_refer_follow():
    """A joint that mimics another mimics that of its own robot."""
    mimic = b"""<robot name="r"><link name="a"/><link name="b"/><link name="c"/><material name="red"/>
      <joint name="one" type="continuous"><parent link="a"/><child link="b"/></joint>
      <joint name="two" type="continuous"><parent link="a"/><child link="c"/><mimic joint="one"/></joint>
      <gazebo reference="b"/><gazebo/></robot>"""
    text = merged_urdf({"eye": RobotPart(mimic, "a", "a")}, "eye", {})
    for part in ('<mimic joint="eye_one"', '<gazebo reference="eye_b"', '<material name="eye_red"', "<gazebo />"):
        assert part in text


def test_what_cannot_be_merged_is_said():
    """A base that hangs on a turning joint, and one that does not exist."""
    with pytest.raises(InputError, match=r"eye\.urdf: joint 'shoulder_pan' above 'shoulder' is not fixed"):
        merged_urdf(parts("shoulder"), "eye", {"hand": POSE})
    with pytest.raises(FrameNotFound, match="no 'bass_link'"):
        merged_urdf(parts("bass_link"), "eye", {"hand": POSE})


def test_links_are_listed():
    """In the order of the file."""
    assert link_names(SCENE)[:2] == ["table", "left_mount"]
