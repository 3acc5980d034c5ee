"""Read the serial chain between two links of a URDF, or of an MJCF."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.errors import DatasetError, FrameNotFound, list_names
from basecal.geometry import SE3, Array
from basecal.kinematics.chain import Masses, SerialChain
from basecal.kinematics.collision import Collision, numbers_in_text
from basecal.kinematics.mjcf import chain_of_mjcf

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

LARGEST_BYTES = 2**25
"""Largest size of a URDF: 32 MB, a hundred times that of the largest arm with tools."""

_MOST_JOINTS = 64  # most turning joints from base to flange: arms have six or seven, snake robots thirty
_LARGEST_VALUE = 1e6  # largest valid number [m, rad]: the same as in the files of a cell, far from overflow
_TURNING_TYPES = ("revolute", "continuous")
_NO_PATH = "<text>"  # path in errors of a text that was not read from a file


@dataclass(frozen=True)
class _Joint:
    """A joint element of a file, with the attributes common to all joints."""

    path: str
    element: Element
    name: str
    kind: str
    parent: str
    child: str

    def error(self, part: str, message: str) -> DatasetError:
        """Make an error with the path of the file and the name of the joint."""
        return DatasetError(self.path, message, field=f"joint {self.name!r} {part}".rstrip())


class _Carrier(NamedTuple):
    """Index of the turning joint that carries a link, None if there is none, and the link's pose in its frame."""

    joint: int | None
    joint_from_link: SE3


def read_chain(path: str | Path, base_link: str, flange_link: str, folder: str | Path = "") -> SerialChain:
    """Read the chain of revolute joints from `base_link` to `flange_link` of a URDF or MJCF file.

    Args:
        path: An expanded URDF, not a xacro; or an MJCF, whose bodies are links and whose flange may be a site.
        base_link: Name of the first link of the chain.
        flange_link: Name of the last link of the chain.
        folder: Folder with the file and the meshes of <collision> elements; by default the file's own folder.

    Raises:
        DatasetError: if the file cannot be read, or its links are not a tree. It is also raised if a joint of the chain
            is neither turning nor fixed, mimics another joint, or has invalid numbers.
        FrameNotFound: if a link does not exist.
        MissingExtra: if the file is an MJCF and MuJoCo is not installed.

    Source: https://wiki.ros.org/urdf/XML/joint.
    """
    text = read_bounded(path, LARGEST_BYTES)
    root = _xml(text, str(path))
    if root.tag == "mujoco":
        return chain_of_mjcf(root, base_link, flange_link, str(path))
    return parse_chain(text, base_link, flange_link, str(path), Path(folder or Path(path).parent))


def parse_chain(
    text: str | bytes, base_link: str, flange_link: str, path: str = _NO_PATH, folder: Path | None = None
) -> SerialChain:
    """Parse the chain of revolute joints from `base_link` to `flange_link` of a URDF's text.

    Collision bodies are kept if the `folder` of their meshes is given.

    Raises:
        DatasetError: as in `read_chain`, with `path` in the message.
        FrameNotFound: if a link does not exist.
    """
    joints, parents, links = _joint_path(text, base_link, flange_link, path)
    turning: list[_Joint] = []
    origins: list[SE3] = []
    since_last = SE3.identity()
    for joint in joints:
        since_last = since_last @ _origin(joint)
        if joint.kind in _TURNING_TYPES:
            turning.append(joint)
            origins.append(since_last)
            since_last = SE3.identity()
        elif joint.kind != "fixed":
            raise joint.error("type", f"{joint.kind!r} between base and flange, expected revolute, continuous or fixed")
    limits = np.array([_limits(joint) for joint in turning])
    axes = np.array([_axis(joint) for joint in turning])
    names = tuple(joint.name for joint in turning)
    chain = SerialChain(names, SE3.stack(origins), axes, since_last, limits[:, 0], limits[:, 1])
    bodies = () if folder is None else _collisions(chain.joint_names, parents, links, base_link, (Path(path), folder))
    masses = _masses(chain.joint_names, parents, links, _gravity_direction(parents, base_link), path)
    return replace(chain, masses=masses, collisions=bodies)


@dataclass(frozen=True, eq=False)
class JointOrigin:
    """A joint of a URDF, and the pose of its child at angle zero.

    Attributes:
        name: Name of the joint.
        kind: `fixed`, `revolute` or another joint type of URDF.
        parent: Name of the parent link.
        child: Name of the child link.
        parent_from_child: Origin of the joint.
    """

    name: str
    kind: str
    parent: str
    child: str
    parent_from_child: SE3


def joint_origins(text: str | bytes, path: str = _NO_PATH) -> dict[str, JointOrigin]:
    """Parent joint of each link except the root, by name of the link.

    Raises:
        DatasetError: if the text is not a URDF, its links are not a tree, or an origin is invalid. The message names
            `path`.
    """
    return {
        link: JointOrigin(joint.name, joint.kind, joint.parent, link, _origin(joint))
        for link, joint in _tree(text, path)[0].items()
    }


def path_joint_names(text: str | bytes, base_link: str, flange_link: str) -> tuple[str, ...]:
    """Names of all joints from `base_link` to `flange_link`, including fixed joints.

    Raises:
        DatasetError: as in `read_chain`.
        FrameNotFound: if a link does not exist.
    """
    return tuple(joint.name for joint in _joint_path(text, base_link, flange_link, _NO_PATH)[0])


def _joint_path(
    text: str | bytes, base_link: str, flange_link: str, path: str
) -> tuple[list[_Joint], dict[str, _Joint], list[Element]]:
    """Joints from `base_link` to `flange_link`, parent joint of each link by name, and elements of all links."""
    parents, links = _tree(text, path)
    for link in (base_link, flange_link):
        if link not in links:
            raise FrameNotFound(link, [*links])
    joints = _joints_up_to(parents, flange_link, base_link)
    if joints is None:
        highest = flange_link  # becomes the root of its tree
        for _ in parents:
            highest = parents[highest].parent if highest in parents else highest
        is_exchanged = _joints_up_to(parents, base_link, flange_link) is not None
        place = "above it: exchange base_link and flange_link" if is_exchanged else f"below {highest!r}"
        raise DatasetError(path, f"{flange_link!r} is not below {base_link!r}, but {place}")
    turning = sum(joint.kind in _TURNING_TYPES for joint in joints)
    if not 0 < turning <= _MOST_JOINTS:
        place = f"between {base_link!r} and {flange_link!r}"
        count = f"{turning} revolute joints" if turning else "no revolute joint"
        raise DatasetError(path, f"{count} {place}; arms have up to {_MOST_JOINTS}")
    return joints[::-1], parents, list(links.values())


def _xml(text: str | bytes, path: str) -> Element:
    from xml.etree.ElementTree import ParseError

    from defusedxml.ElementTree import fromstring

    try:
        root: Element = fromstring(text)
    except ParseError as error:
        raise DatasetError(path, f"not well-formed XML: {error}", line=error.position[0]) from error
    except (ValueError, LookupError) as error:
        raise DatasetError(path, f"not XML that can be read safely: {error}") from error
    return root


def _attribute(path: str, element: Element, key: str, label: str = "") -> str:
    value = element.get(key)
    if not value:
        raise DatasetError(path, f"has no {key!r}", field=label or element.tag)
    return value


def _unique(names: list[str], kind: str, path: str) -> list[str]:
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise DatasetError(path, "given twice, names are unique", field=f"{kind} {repeated[0]!r}")
    return names


def _joint(path: str, element: Element) -> _Joint:
    name = _attribute(path, element, "name")
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        if end is None:
            raise DatasetError(path, f"has no element {tag!r}", field=f"joint {name!r}")
        ends.append(_attribute(path, end, "link", f"joint {name!r} {tag}"))
    return _Joint(path, element, name, _attribute(path, element, "type", f"joint {name!r}"), *ends)


def _tree(text: str | bytes, path: str) -> tuple[dict[str, _Joint], dict[str, Element]]:
    """Parent joint of each link except the root, and elements of all links, by name.

    Raises:
        DatasetError: if the text is not a URDF, names are not unique, or a joint refers to a missing link. It is also
            raised if a link has two parents, or there is not exactly one root.
    """
    root = _xml(text, path)
    if root.tag != "robot":
        raise DatasetError(path, f"the root element is {root.tag!r}, expected 'robot'")
    elements = root.findall("link")
    links = _unique([_attribute(path, element, "name") for element in elements], "link", path)
    joints = [_joint(path, element) for element in root.findall("joint")]
    _unique([joint.name for joint in joints], "joint", path)
    parents: dict[str, _Joint] = {}
    known = frozenset(links)
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in known:
                raise joint.error("", f"names the link {link!r}, which does not exist")
        if joint.child in parents:
            raise joint.error(
                "child", f"{joint.child!r} already has the parent joint {parents[joint.child].name!r}: not a tree"
            )
        parents[joint.child] = joint
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        what = f"not a tree: the links without a parent are {list_names(roots)}, expected one"
        raise DatasetError(path, f"{what}; join several robots by fixed joints, or give each a file of its own")
    return parents, dict(zip(links, elements, strict=True))


def _numbers(joint: _Joint, tag: str, key: str, default: str, count: int) -> Array:
    """Parse `count` finite numbers of an attribute of a joint's element.

    Raises:
        DatasetError: if the attribute is not `count` finite numbers.
    """
    element = joint.element.find(tag)
    text = default if element is None else element.get(key, default)
    numbers = numbers_in_text(text, count, _LARGEST_VALUE)
    if numbers is None:
        wanted = f"{'a finite number' if count == 1 else f'{count} finite numbers'} within {_LARGEST_VALUE:g}"
        raise joint.error(f"{tag} {key}", f"expected {wanted}, got {text!r}; expand a xacro first")
    return numbers


def _origin(joint: _Joint) -> SE3:
    return SE3.from_rpy(_numbers(joint, "origin", "rpy", "0 0 0", 3), _numbers(joint, "origin", "xyz", "0 0 0", 3))


def _axis(joint: _Joint) -> Array:
    if joint.element.find("mimic") is not None:
        raise joint.error("mimic", "a joint that mimics another is not supported between base and flange")
    axis = _numbers(joint, "axis", "xyz", "1 0 0", 3)
    length = np.linalg.norm(axis)
    if length < 1e-9:
        raise joint.error("axis xyz", "has no direction, expected three numbers that are not all zero")
    unit: Array = axis / length
    return unit


def _limits(joint: _Joint) -> tuple[float, float]:
    if joint.kind == "continuous":
        return -np.inf, np.inf
    if joint.element.find("limit") is None:
        raise joint.error("limit", "missing; a revolute joint has 'lower' and 'upper', else it is 'continuous'")
    lower, upper = (float(_numbers(joint, "limit", key, "0", 1)[0]) for key in ("lower", "upper"))
    if lower > upper:
        raise joint.error("limit", f"lower {lower:g} is above upper {upper:g}")
    return lower, upper


def _gravity_direction(parents: dict[str, _Joint], base_link: str) -> Array:
    """Direction of gravity in the base, with z of the root link up; joints above the base are at zero."""
    root = next((joint.parent for joint in parents.values() if joint.parent not in parents), base_link)
    root_from_base = SE3.identity()
    for joint in _joints_up_to(parents, base_link, root) or ():
        root_from_base = _origin(joint) @ root_from_base
    down: Array = -root_from_base.rotation[2]
    return down


def _masses(
    turning: tuple[str, ...], parents: dict[str, _Joint], links: list[Element], gravity: Array, path: str
) -> Masses | None:
    """Masses of the links, assigned to the nearest joint of the chain above each link; other joints are at zero.

    None if no joint of the chain carries a mass.
    """
    n, carriers = len(turning), {name: number for number, name in enumerate(turning)}
    known_carriers: dict[str, _Carrier] = {}
    kg, moments = np.zeros(n), np.zeros((n, 3))
    for link in links:
        inertial = link.find("inertial")
        if inertial is None:
            continue
        mass, centre = _inertial(inertial, path, str(link.get("name")))
        joint, joint_from_link = _carrying_joint(str(link.get("name")), carriers, parents, known_carriers)
        if joint is not None:
            kg[joint] += mass
            moments[joint] += mass * (joint_from_link @ centre)
    return Masses(kg, moments / np.where(kg > 0, kg, 1.0)[:, None], gravity) if np.any(kg) else None


def _collisions(
    turning: tuple[str, ...], parents: dict[str, _Joint], links: list[Element], base_link: str, files: tuple[Path, Path]
) -> tuple[Collision, ...]:
    """Collision bodies fixed to the base or to a turning joint of the chain, and all bodies below the last joint."""
    carriers, found = {name: number for number, name in enumerate(turning)}, list[Collision]()
    rigid_parents = {link: joint for link, joint in parents.items() if joint.kind == "fixed" or joint.name in carriers}
    rigid_carriers: dict[str, _Carrier] = {base_link: _Carrier(-1, SE3.identity())}
    moving_carriers: dict[str, _Carrier] = {}
    for link in links:
        name, bodies = str(link.get("name")), link.findall("collision")
        if not bodies:
            continue
        carrier = _carrying_joint(name, carriers, rigid_parents, rigid_carriers)
        if carrier.joint is None:
            carrier = _carrying_joint(name, carriers, parents, moving_carriers)
            if carrier.joint != len(turning) - 1:
                continue
        found += [Collision(name, carrier.joint + 1, carrier.joint_from_link, body, *files) for body in bodies]
    return tuple(found)


def _carrying_joint(
    link: str, turning: Mapping[str, int], parents: Mapping[str, _Joint], carriers: dict[str, _Carrier]
) -> _Carrier:
    """Find the turning joint that carries a link, and the pose of the link in the joint's frame.

    `carriers` is a cache of the results by link, so that each joint of a tree is visited once.
    """
    visited: list[str] = []
    while link not in carriers:
        visited.append(link)
        if link not in parents:
            carriers[link] = _Carrier(None, SE3.identity())
        elif parents[link].name in turning:
            carriers[link] = _Carrier(turning[parents[link].name], SE3.identity())
        else:
            link = parents[link].parent
    for child in reversed([name for name in visited if name not in carriers]):
        parent = carriers[parents[child].parent]
        carriers[child] = _Carrier(parent.joint, parent.joint_from_link @ _origin(parents[child]))
    return carriers[visited[0] if visited else link]


def _inertial(element: Element, path: str, link: str) -> tuple[float, Array]:
    """Parse the mass [kg] and the centre of mass in the link, (3,) [m].

    Raises:
        DatasetError: if the values are not finite numbers, or the mass is negative.
    """
    mass, origin = element.find("mass"), element.find("origin")
    kg = "" if mass is None else mass.get("value", "")
    xyz = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
    numbers = numbers_in_text(f"{kg} {xyz}", 4, _LARGEST_VALUE)
    if numbers is None or numbers[0] < 0:
        got = f"mass {kg!r}, origin {xyz!r}"
        raise DatasetError(path, f"expected a mass >= 0 and three numbers, got {got}", field=f"link {link!r} inertial")
    return float(numbers[0]), numbers[1:]


def _joints_up_to(parents: dict[str, _Joint], link: str, end: str) -> list[_Joint] | None:
    """Joints from a link up to another link; None if the other link is not above it."""
    joints: list[_Joint] = []
    while link != end:
        if link not in parents or len(joints) > len(parents):
            return None
        joints.append(parents[link])
        link = joints[-1].parent
    return joints
