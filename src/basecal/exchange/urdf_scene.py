"""URDFs that say where robots stand: a joint's origin replaced in one, or one made of several robots'."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from basecal.errors import FrameNotFound, InputError
from basecal.exchange.urdf import parsed_urdf, set_origin, write_urdf
from basecal.geometry import SE3
from basecal.kinematics.urdf import JointOrigin, joint_origins

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_NAMED_ELEMENTS = ("link", "joint", "material", "transmission", "actuator", "ros2_control")
_REFERRING = {"parent": "link", "child": "link", "mimic": "joint", "gazebo": "reference"}


@dataclass(frozen=True, eq=False)
class RobotPart:
    """A robot of a scene.

    Attributes:
        text: Its URDF.
        base_link: The link of it whose place is known.
        path: What to call the file in errors.
    """

    text: bytes
    base_link: str
    path: str


def link_names(text: bytes) -> list[str]:
    """Names of the links of a URDF that has been read before."""
    return [str(element.get("name")) for element in parsed_urdf(text).findall("link")]


def patched_urdf(
    text: bytes,
    parent_link: str,
    child_link: str,
    parent_from_child: SE3,
    *,
    joint: str | None = None,
    remarks: Sequence[str] = (),
    path: str = "<text>",
) -> str:
    """A URDF in which one link stands in another as is said, by the origin of a fixed joint between them.

    The other joints between both links keep their origins, and so does all else.

    Args:
        text: The URDF.
        parent_link: A link.
        child_link: Another.
        parent_from_child: Where it is to stand in the first.
        joint: Whose origin is replaced; needed where several joints are between both links.
        remarks: Where it comes from, written as comments.
        path: What to call the file in errors.

    Raises:
        DatasetError: if the text is no URDF.
        FrameNotFound: if there is no such link, or no such joint between both.
        InputError: if a joint between both is not fixed, or none of several is named.
    """
    above, links = joint_origins(text, path), link_names(text)
    for link in (parent_link, child_link):
        if link not in links:
            raise FrameNotFound(link, links)
    up_from_parent, up_from_child = _joints_between(above, parent_link, child_link)
    chosen = _choose_joint([*up_from_parent, *up_from_child], joint, f"{parent_link!r} and {child_link!r}")
    if chosen in up_from_child:
        moved = _origin(chosen, up_from_parent, up_from_child, parent_from_child)
    else:
        moved = _origin(chosen, up_from_child, up_from_parent, parent_from_child.inverse())
    root = parsed_urdf(text)
    (element,) = (each for each in root.findall("joint") if each.get("name") == chosen.name)
    set_origin(element, moved)
    return write_urdf(root, remarks)


def merged_urdf(
    parts: Mapping[str, RobotPart], reference: str, places: Mapping[str, SE3], remarks: Sequence[str] = ()
) -> str:
    """A URDF of several robots, each link and joint of which has the name of its robot before its own.

    Args:
        parts: The robots by name.
        reference: The one that the others stand in.
        places: `reference_base_from_base` of each other robot.
        remarks: Where it comes from, written as comments.

    Raises:
        DatasetError: if a text is no URDF.
        FrameNotFound: if a base link does not exist.
        InputError: if a joint between a root and its base link is not fixed.
    """
    from xml.etree.ElementTree import Element, SubElement

    roots = {name: _root_link(part) for name, part in parts.items()}
    root = Element("robot", name="_and_".join(parts))
    for name, part in parts.items():
        whole = parsed_urdf(part.text)
        _prefix(whole, f"{name}_")
        root.extend(list(whole))
    for name, reference_from_base in places.items():
        top, root_from_base = roots[name]
        joint = SubElement(root, "joint", name=f"{reference}_base_to_{name}_base", type="fixed")
        SubElement(joint, "parent", link=f"{reference}_{parts[reference].base_link}")
        SubElement(joint, "child", link=f"{name}_{top}")
        set_origin(joint, reference_from_base @ root_from_base.inverse())
    return write_urdf(root, remarks)


def _joints_to_root(parent_joints: Mapping[str, JointOrigin], link: str) -> list[JointOrigin]:
    """Joints from a link to the root."""
    joints = []
    while link in parent_joints:
        joints.append(parent_joints[link])
        link = parent_joints[link].parent
    return joints


def _joints_between(
    parent_joints: Mapping[str, JointOrigin], first: str, second: str
) -> tuple[list[JointOrigin], list[JointOrigin]]:
    """Joints from each of two links up to where they meet."""
    ups = _joints_to_root(parent_joints, first), _joints_to_root(parent_joints, second)
    common = {joint.name for joint in ups[0]} & {joint.name for joint in ups[1]}
    own = [[joint for joint in up if joint.name not in common] for up in ups]
    return own[0], own[1]


def _choose_joint(joints: Sequence[JointOrigin], name: str | None, frames: str) -> JointOrigin:
    turning = [joint.name for joint in joints if joint.kind != "fixed"]
    if turning:
        raise InputError(f"joint {turning[0]!r} between {frames} is not fixed: their place is not one transform")
    names = [joint.name for joint in joints]
    if name is None and len(joints) != 1:
        raise InputError(f"between {frames} are {len(joints)} joints; say whose origin, with --joint: {names}")
    wanted = names[0] if name is None else name
    if wanted not in names:
        raise FrameNotFound(wanted, names)
    return joints[names.index(wanted)]


def _product(joints: Sequence[JointOrigin]) -> SE3:
    """`top_from_link` of joints from a link upwards."""
    whole = SE3.identity()
    for joint in joints:
        whole = joint.parent_from_child @ whole
    return whole


def _origin(joint: JointOrigin, up_from_a: list[JointOrigin], up_from_b: list[JointOrigin], a_from_b: SE3) -> SE3:
    """The origin of a joint above b that puts b where it is to stand in a."""
    place = up_from_b.index(joint)
    child_from_b, top_from_parent = _product(up_from_b[:place]), _product(up_from_b[place + 1 :])
    top_from_b = _product(up_from_a) @ a_from_b
    return top_from_parent.inverse() @ top_from_b @ child_from_b.inverse()


def _root_link(part: RobotPart) -> tuple[str, SE3]:
    """The root link of a robot, and `root_from_base`."""
    above, links = joint_origins(part.text, part.path), link_names(part.text)
    if part.base_link not in links:
        raise FrameNotFound(part.base_link, links)
    up = _joints_to_root(above, part.base_link)
    turning = [joint.name for joint in up if joint.kind != "fixed"]
    if turning:
        raise InputError(
            f"{part.path}: joint {turning[0]!r} above {part.base_link!r} is not fixed: no base hangs there"
        )
    return (up[-1].parent if up else part.base_link), _product(up)


def _prefix(root: Element, prefix: str) -> None:
    for element in root.iter():
        attribute = "name" if element.tag in _NAMED_ELEMENTS else _REFERRING.get(str(element.tag))
        if attribute is not None and element.get(attribute):
            element.set(attribute, prefix + element.get(attribute, ""))
