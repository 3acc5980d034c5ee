"""A transform as a URDF says it, and a URDF with a robot's calibration in it: metres, angles about fixed x, y, z."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from basecal.errors import InputError
from basecal.exchange.exports.quoting import xml_comment
from basecal.geometry import SE3, Array
from basecal.kinematics import SerialChain, parse_chain, path_joint_names

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


def numbers(values: Iterable[float]) -> str:
    """Numbers to paste: fixed point, a space between, no negative zero."""
    return " ".join(f"{round(float(value), 9) + 0.0:.9f}" for value in values)


def origin_line(parent_from_child: SE3) -> str:
    """The `<origin>` of the joint that holds the child's frame in the parent's."""
    return f'<origin xyz="{numbers(parent_from_child.translation)}" rpy="{numbers(parent_from_child.rpy)}"/>'


def corrected_urdf(
    text: str | bytes,
    base_link: str,
    flange_link: str,
    offsets: Array | None = None,
    links: Array | None = None,
    note: str | None = None,
) -> str:
    """A URDF whose robot stands at recorded joints where the calibrated one does.

    An offset rotates what follows a joint about its axis. A link error moves an origin on its right before that:
    origin' = origin @ SE3.exp(link) @ turn(axis, offset). All else of the URDF stays as it is.

    Args:
        text: The URDF.
        base_link: Root of the chain that was calibrated.
        flange_link: Its tip.
        offsets: (n,) joint offsets [rad]; none if None.
        links: (n + 1, 6) right tangents of the origins, then of the tip [m, rad]; none if None.
        note: Where it comes from, written as a comment into it.

    Raises:
        DatasetError: if the URDF cannot be used.
        FrameNotFound: if a link does not exist.
        InputError: if the numbers of errors and joints differ, or the tip is moved and no fixed joint follows the last
            one to hold it.
    """
    chain = parse_chain(text, base_link, flange_link)
    for name, errors, size in (("joint offsets", offsets, chain.n), ("link parameters", links, chain.n + 1)):
        if errors is not None and len(errors) != size:
            raise InputError(f"{len(errors)} {name} do not suit {chain.n} joints from {base_link!r} to {flange_link!r}")
    # What each joint's origin, and the tip, is moved by on its right
    tangents = np.zeros((chain.n + 1, 6)) if links is None else links
    turns = chain.axes * (np.zeros(chain.n) if offsets is None else offsets)[:, None]
    moved = [SE3.exp(tangents[i]) @ SE3.from_rotvec(turns[i], np.zeros(3)) for i in range(chain.n)]
    joint_moves, tip_move = moved, SE3.exp(tangents[-1])
    root = parsed_urdf(text)
    by_name = {str(element.get("name")): element for element in root.findall("joint")}
    for name, move in zip(chain.joint_names, joint_moves, strict=True):
        _move(by_name[name], move)
    if np.any(tip_move.log()):
        last = path_joint_names(text, base_link, flange_link)[-1]
        if last in chain.joint_names:
            raise InputError(
                f"the calibration moves the tip of the chain, and {flange_link!r} hangs on the turning joint {last!r}. "
                "End the chain at a link behind a fixed joint"
            )
        _move(by_name[last], tip_move)
    return write_urdf(root, () if note is None else (note,))


def chain_urdf(chain: SerialChain, base_link: str, flange_link: str, name: str = "robot") -> str:
    """The URDF of a chain and nothing else.

    Args:
        chain: The arm; a joint without limits is written as `continuous`.
        base_link: What to call its root.
        flange_link: What to call its tip.
        name: What to call the robot.
    """
    from xml.etree.ElementTree import Element, SubElement, indent

    root = Element("robot", name=name)
    links = [base_link, *(f"{joint}_link" for joint in chain.joint_names), flange_link]
    for k, link in enumerate(links):
        element = SubElement(root, "link", name=link)
        if chain.masses is not None and 0 < k <= chain.n:
            inertial = SubElement(element, "inertial")
            SubElement(inertial, "origin", xyz=exactly(chain.masses.centres[k - 1]))
            SubElement(inertial, "mass", value=repr(float(chain.masses.kg[k - 1])))
    origins = [*(chain.origins[i] for i in range(chain.n)), chain.tip]
    names = (*chain.joint_names, f"{flange_link}_joint")
    for k, (joint, origin) in enumerate(zip(names, origins, strict=True)):
        limited = k < chain.n and bool(np.all(np.isfinite([chain.lower[k], chain.upper[k]])))
        kind = "fixed" if k == chain.n else "revolute" if limited else "continuous"
        element = SubElement(root, "joint", name=joint, type=kind)
        SubElement(element, "parent", link=links[k])
        SubElement(element, "child", link=links[k + 1])
        SubElement(element, "origin", xyz=exactly(origin.translation), rpy=exactly(origin.rpy))
        if k < chain.n:
            SubElement(element, "axis", xyz=exactly(chain.axes[k]))
        if limited:
            lower, upper = repr(float(chain.lower[k])), repr(float(chain.upper[k]))
            SubElement(element, "limit", lower=lower, upper=upper, effort="100", velocity="3")
    indent(root)
    return write_urdf(root)


def parsed_urdf(text: str | bytes) -> Element:
    """The root element of a URDF, comments inside it kept."""
    from xml.etree.ElementTree import TreeBuilder

    from defusedxml.ElementTree import XMLParser

    parser = XMLParser(target=TreeBuilder(insert_comments=True))
    parser.feed(text)
    root: Element = parser.close()
    return root


def _move(joint: Element, move: SE3) -> None:
    """Move an origin on its right."""
    origin = joint.find("origin")
    words = {} if origin is None else origin.attrib
    rpy, xyz = ([float(word) for word in words.get(key, "0 0 0").split()] for key in ("rpy", "xyz"))
    if np.any(move.log()):
        set_origin(joint, SE3.from_rpy(rpy, xyz) @ move)


def set_origin(joint: Element, parent_from_child: SE3) -> None:
    """Write the origin of a joint, with as many digits as bring it back exactly."""
    from xml.etree.ElementTree import SubElement

    origin = joint.find("origin")
    origin = SubElement(joint, "origin") if origin is None else origin
    origin.set("xyz", exactly(parent_from_child.translation))
    origin.set("rpy", exactly(parent_from_child.rpy))


def write_urdf(root: Element, remarks: Sequence[str] = ()) -> str:
    """The text of a URDF, remarks first."""
    from xml.etree.ElementTree import tostring

    for place, line in enumerate(remarks):
        root.insert(place, xml_comment(line))
    return tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def exactly(values: Array) -> str:
    """Numbers with as many digits as bring them back."""
    return " ".join(repr(float(value) + 0.0) for value in values)
