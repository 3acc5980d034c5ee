"""URDF files with calibrated origins and joints: metres, and angles about fixed x, y, z axes [rad]."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.exporter import xml_comment
from basecal.geometry import SE3, Array
from basecal.kinematics import SerialChain, parse_chain, path_joint_names
from basecal.kinematics.urdf import JointOrigin, joint_origins

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_NAMED_ELEMENTS = ("link", "joint", "material", "transmission", "actuator", "ros2_control")
_REFERRING_ATTRIBUTES = {"parent": "link", "child": "link", "mimic": "joint", "gazebo": "reference"}


def numbers(values: Iterable[float]) -> str:
    """Format numbers with nine decimals, separated by spaces, without negative zeros."""
    return " ".join(f"{round(float(value), 9) + 0.0:.9f}" for value in values)


def origin_line(parent_from_child: SE3) -> str:
    """Format the `<origin>` element of the joint from parent to child."""
    return f'<origin xyz="{numbers(parent_from_child.translation)}" rpy="{numbers(parent_from_child.rpy)}"/>'


def corrected_urdf(
    text: str | bytes,
    base_link: str,
    flange_link: str,
    offsets: Array | None = None,
    links: Array | None = None,
    note: str | None = None,
) -> str:
    """Apply calibrated joint offsets and link errors to a URDF.

    With the result, recorded joints give the flange poses of the calibrated robot. Each joint origin becomes
    origin' = origin @ SE3.exp(link) @ rotation(axis, offset). The rest of the URDF is unchanged.

    Args:
        text: The URDF.
        base_link: Root link of the calibrated chain.
        flange_link: Tip link of the calibrated chain.
        offsets: (n,) joint offsets [rad]; None for zeros.
        links: (n + 1, 6) right tangents of the origins, then of the tip [m, rad]; None for zeros.
        note: Source of the calibration, written as a comment.

    Raises:
        DatasetError: if the URDF cannot be used.
        FrameNotFound: if a link does not exist.
        InputError: if the numbers of errors and joints differ, or the tip moves but the last joint is not fixed.
    """
    chain = parse_chain(text, base_link, flange_link)
    for name, errors, size in (("joint offsets", offsets, chain.n), ("link parameters", links, chain.n + 1)):
        if errors is not None and len(errors) != size:
            raise InputError(f"{len(errors)} {name} do not fit {chain.n} joints from {base_link!r} to {flange_link!r}")
    # Right-multiplied corrections of each joint's origin, and of the tip
    tangents = np.zeros((chain.n + 1, 6)) if links is None else links
    turns = chain.axes * (np.zeros(chain.n) if offsets is None else offsets)[:, None]
    joint_moves = [SE3.exp(tangents[i]) @ SE3.from_rotvec(turns[i], np.zeros(3)) for i in range(chain.n)]
    tip_move = SE3.exp(tangents[-1])
    root = parsed_urdf(text)
    by_name = {str(element.get("name")): element for element in root.findall("joint")}
    for name, move in zip(chain.joint_names, joint_moves, strict=True):
        _move(by_name[name], move)
    if np.any(tip_move.log()):
        last = path_joint_names(text, base_link, flange_link)[-1]
        if last in chain.joint_names:
            raise InputError(
                f"the calibration corrects the tip of the chain, but {last!r} above {flange_link!r} is not fixed. "
                "End the chain at a link behind a fixed joint"
            )
        _move(by_name[last], tip_move)
    return write_urdf(root, () if note is None else (note,))


def chain_urdf(chain: SerialChain, base_link: str, flange_link: str, name: str = "robot") -> str:
    """Create the URDF of a single chain.

    Args:
        chain: The chain; a joint without limits is written as `continuous`.
        base_link: Name of the root link.
        flange_link: Name of the tip link.
        name: Name of the robot.
    """
    from xml.etree.ElementTree import Element, SubElement, indent

    root = Element("robot", name=name)
    links = [base_link, *(f"{joint}_link" for joint in chain.joint_names), flange_link]
    for k, link in enumerate(links):
        element = SubElement(root, "link", name=link)
        if chain.masses is not None and 0 < k <= chain.n:
            inertial = SubElement(element, "inertial")
            SubElement(inertial, "origin", xyz=exact_text(chain.masses.centres[k - 1]))
            SubElement(inertial, "mass", value=repr(float(chain.masses.kg[k - 1])))
    origins = [*(chain.origins[i] for i in range(chain.n)), chain.tip]
    names = (*chain.joint_names, f"{flange_link}_joint")
    for k, (joint, origin) in enumerate(zip(names, origins, strict=True)):
        limited = k < chain.n and bool(np.all(np.isfinite([chain.lower[k], chain.upper[k]])))
        kind = "fixed" if k == chain.n else "revolute" if limited else "continuous"
        element = SubElement(root, "joint", name=joint, type=kind)
        SubElement(element, "parent", link=links[k])
        SubElement(element, "child", link=links[k + 1])
        SubElement(element, "origin", xyz=exact_text(origin.translation), rpy=exact_text(origin.rpy))
        if k < chain.n:
            SubElement(element, "axis", xyz=exact_text(chain.axes[k]))
        if limited:
            lower, upper = repr(float(chain.lower[k])), repr(float(chain.upper[k]))
            SubElement(element, "limit", lower=lower, upper=upper, effort="100", velocity="3")
    indent(root)
    return write_urdf(root)


def parsed_urdf(text: str | bytes) -> Element:
    """Parse a URDF and return its root element, with the comments inside it."""
    from xml.etree.ElementTree import TreeBuilder

    from defusedxml.ElementTree import XMLParser

    parser = XMLParser(target=TreeBuilder(insert_comments=True))
    parser.feed(text)
    root: Element = parser.close()
    return root


def _move(joint: Element, move: SE3) -> None:
    """Multiply a joint's origin by a transform from the right; an identity leaves the text unchanged."""
    origin = joint.find("origin")
    texts = {} if origin is None else origin.attrib
    rpy, xyz = ([float(word) for word in texts.get(key, "0 0 0").split()] for key in ("rpy", "xyz"))
    if np.any(move.log()):
        set_origin(joint, SE3.from_rpy(rpy, xyz) @ move)


def set_origin(joint: Element, parent_from_child: SE3) -> None:
    """Set the origin of a joint, with enough digits to restore the numbers exactly."""
    from xml.etree.ElementTree import SubElement

    origin = joint.find("origin")
    origin = SubElement(joint, "origin") if origin is None else origin
    origin.set("xyz", exact_text(parent_from_child.translation))
    origin.set("rpy", exact_text(parent_from_child.rpy))


def write_urdf(root: Element, remarks: Sequence[str] = ()) -> str:
    """Format a URDF as text, with remarks as comments at its start."""
    from xml.etree.ElementTree import tostring

    for index, line in enumerate(remarks):
        root.insert(index, xml_comment(line))
    return tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def exact_text(values: Array) -> str:
    """Format numbers with enough digits to restore them exactly."""
    return " ".join(repr(float(value) + 0.0) for value in values)


@dataclass(frozen=True, eq=False)
class RobotPart:
    """A robot to be merged into a URDF of several robots.

    Attributes:
        text: The robot's URDF.
        base_link: The link whose pose is known.
        path: Name of the file in errors.
    """

    text: bytes
    base_link: str
    path: str


def link_names(text: bytes) -> list[str]:
    """Names of the links of a valid URDF."""
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
    """Set the transform between two links of a URDF by the origin of a fixed joint between them.

    The rest of the URDF is unchanged, including the origins of other joints between the links.

    Args:
        text: The URDF.
        parent_link: Name of a link.
        child_link: Name of another link.
        parent_from_child: Pose of the child link in the parent link.
        joint: Joint whose origin is replaced; required if several joints are between the links.
        remarks: Source of the transform, written as comments.
        path: Name of the file in errors.

    Raises:
        DatasetError: if the text is not a URDF.
        FrameNotFound: if a link does not exist, or the joint is not between the links.
        InputError: if a joint between the links is not fixed, or `joint` is required but None.
    """
    parent_joints, links = joint_origins(text, path), link_names(text)
    for link in (parent_link, child_link):
        if link not in links:
            raise FrameNotFound(link, links)
    up_from_parent, up_from_child = _joints_between(parent_joints, parent_link, child_link)
    chosen = _choose_joint([*up_from_parent, *up_from_child], joint, f"{parent_link!r} and {child_link!r}")
    if chosen in up_from_child:
        origin = _origin(chosen, up_from_parent, up_from_child, parent_from_child)
    else:
        origin = _origin(chosen, up_from_child, up_from_parent, parent_from_child.inverse())
    root = parsed_urdf(text)
    (element,) = (each for each in root.findall("joint") if each.get("name") == chosen.name)
    set_origin(element, origin)
    return write_urdf(root, remarks)


def merged_urdf(
    parts: Mapping[str, RobotPart], reference: str, bases: Mapping[str, SE3], remarks: Sequence[str] = ()
) -> str:
    """Merge the URDFs of several robots into one; names of links and joints are prefixed by the robot's name.

    Args:
        parts: The robots by name.
        reference: The robot to whose base link the others are attached.
        bases: `reference_base_from_base` of each other robot.
        remarks: Source of the transforms, written as comments.

    Raises:
        DatasetError: if a text is not a URDF.
        FrameNotFound: if a base link does not exist.
        InputError: if a joint between a root and its base link is not fixed.
    """
    from xml.etree.ElementTree import Element, SubElement

    roots = {name: _root_link(part) for name, part in parts.items()}
    root = Element("robot", name="_and_".join(parts))
    for name, part in parts.items():
        robot = parsed_urdf(part.text)
        _prefix_names(robot, f"{name}_")
        root.extend(list(robot))
    for name, reference_from_base in bases.items():
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
    """Joints from each of two links up to their common ancestor."""
    from_first, from_second = _joints_to_root(parent_joints, first), _joints_to_root(parent_joints, second)
    common = {joint.name for joint in from_first} & {joint.name for joint in from_second}
    own_first, own_second = ([j for j in joints if j.name not in common] for joints in (from_first, from_second))
    return own_first, own_second


def _choose_joint(joints: Sequence[JointOrigin], name: str | None, frames: str) -> JointOrigin:
    turning = [joint.name for joint in joints if joint.kind != "fixed"]
    if turning:
        raise InputError(f"joint {turning[0]!r} between {frames} is not fixed: their relative pose is not constant")
    names = [joint.name for joint in joints]
    if name is None and len(joints) != 1:
        raise InputError(f"there are {len(joints)} joints between {frames}; choose one with --joint: {names}")
    chosen = names[0] if name is None else name
    if chosen not in names:
        raise FrameNotFound(chosen, names)
    return joints[names.index(chosen)]


def _product(joints: Sequence[JointOrigin]) -> SE3:
    """`top_from_link` along joints, ordered from the link upwards."""
    product = SE3.identity()
    for joint in joints:
        product = joint.parent_from_child @ product
    return product


def _origin(joint: JointOrigin, up_from_a: list[JointOrigin], up_from_b: list[JointOrigin], a_from_b: SE3) -> SE3:
    """Origin of a joint above b for which the pose of b in a is `a_from_b`."""
    index = up_from_b.index(joint)
    child_from_b, top_from_parent = _product(up_from_b[:index]), _product(up_from_b[index + 1 :])
    top_from_b = _product(up_from_a) @ a_from_b
    return top_from_parent.inverse() @ top_from_b @ child_from_b.inverse()


def _root_link(part: RobotPart) -> tuple[str, SE3]:
    """Root link of a robot, and `root_from_base`."""
    parent_joints, links = joint_origins(part.text, part.path), link_names(part.text)
    if part.base_link not in links:
        raise FrameNotFound(part.base_link, links)
    up = _joints_to_root(parent_joints, part.base_link)
    turning = [joint.name for joint in up if joint.kind != "fixed"]
    if turning:
        raise InputError(
            f"{part.path}: joint {turning[0]!r} above {part.base_link!r} is not fixed: a base needs a fixed joint"
        )
    return (up[-1].parent if up else part.base_link), _product(up)


def _prefix_names(root: Element, prefix: str) -> None:
    """Put a prefix before the names of links and joints, and before references to them."""
    for element in root.iter():
        attribute = "name" if element.tag in _NAMED_ELEMENTS else _REFERRING_ATTRIBUTES.get(str(element.tag))
        if attribute is not None and element.get(attribute):
            element.set(attribute, prefix + element.get(attribute, ""))
