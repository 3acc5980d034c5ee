"""Read the serial chain between two bodies of an MJCF file, MuJoCo's own format.

MuJoCo compiles the model. It receives only bodies and their joints, so that no mesh, image or other file is opened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from basecal.errors import DatasetError, FrameNotFound, MissingExtra, error_words
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import rotation_exp
from basecal.kinematics.chain import Masses, SerialChain

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_KEPT_SECTIONS = frozenset({"compiler", "default", "worldbody"})  # sections that determine the poses of bodies
_DROPPED_ELEMENTS = frozenset({"geom", "mesh", "material", "camera", "light", "composite", "flexcomp", "plugin"})
_FILE_ELEMENTS = frozenset({"include", "attach", "model"})  # elements that refer to other files
# Least mass and inertia of a moving body that MuJoCo accepts; used for bodies without a mass in the file.
_LEAST_MASS_KG, _LEAST_INERTIA_KG_M2 = 1e-9, 1e-12
_WORLD_BODY = 0


def chain_of_mjcf(root: Element, base: str, flange: str, path: str) -> SerialChain:
    """Make the chain of hinge joints from one body to another body or site.

    Args:
        root: The element `mujoco` of the file.
        base: Name of the first body of the chain; `world` always exists.
        flange: Name of the last body or site of the chain.
        path: Path of the file, for errors.

    Raises:
        DatasetError: if the file refers to other files, or MuJoCo cannot compile it. It is also raised if the flange is
            not below the base, or a joint between them is not a hinge.
        FrameNotFound: if a body does not exist.
        MissingExtra: if MuJoCo is not installed.

    Source: https://mujoco.readthedocs.io/en/stable/XMLreference.html.
    """
    model = _compile_model(root, path)
    bodies, last_from_flange = _body_path(model, base, flange, path)
    names: list[str] = []
    origins: list[SE3] = []
    axes: list[Array] = []
    limits: list[Array] = []
    carriers: dict[int, tuple[int, SE3]] = {}  # by body: index of the joint that carries it, and its pose in the joint
    since_last = SE3.identity()
    for body in bodies:
        since_last = since_last @ _pose(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            name = model.joint(joint).name or f"{model.body(body).name}_joint"
            name = f"{name}_{len(names) + 1}" if name in names else name
            if not _is_hinge(model, joint):
                raise DatasetError(
                    path, "is not a hinge, the only type supported between base and flange", field=f"joint {name!r}"
                )
            anchor, axis = SE3.from_rotvec(np.zeros(3), model.jnt_pos[joint]), np.array(model.jnt_axis[joint])
            names.append(name)
            origins.append(since_last @ anchor)
            axes.append(axis)  # MuJoCo normalises axes
            limits.append(model.jnt_range[joint] if model.jnt_limited[joint] else np.array([-np.inf, np.inf]))
            # The body poses of the file hold at the joint angle `ref`.
            back = rotation_exp(-float(model.qpos0[model.jnt_qposadr[joint]]) * axes[-1])
            since_last = SE3(back, np.zeros(3)) @ anchor.inverse()
        if names:
            carriers[body] = len(names) - 1, since_last
    if not names:
        raise DatasetError(path, f"no hinge between {base!r} and {flange!r}")
    lower, upper = np.array(limits).T
    tip, masses = since_last @ last_from_flange, _masses(model, carriers, len(names), _gravity_direction(model, base))
    return SerialChain(tuple(names), SE3.stack(origins), np.array(axes), tip, lower, upper, masses)


def _compile_model(root: Element, path: str) -> Any:
    """Compile the bodies and joints of a file with MuJoCo."""
    from xml.etree.ElementTree import SubElement, tostring

    try:
        import mujoco
    except ImportError:
        raise MissingExtra("sim", "an MJCF") from None
    foreign = next((element.tag for element in root.iter() if element.tag in _FILE_ELEMENTS), None)
    if foreign is not None:
        raise DatasetError(
            path, f"has an element {foreign!r}: write all into one file, MuJoCo does with mj_saveLastXML"
        )
    for section in list(root):
        if section.tag not in _KEPT_SECTIONS:
            root.remove(section)
    for element in list(root.iter()):
        element.attrib.pop("material", None)
        for child in list(element):
            if child.tag in _DROPPED_ELEMENTS:
                element.remove(child)
    for compiler in root.findall("compiler"):
        compiler.attrib.pop("inertiafromgeom", None)
        compiler.attrib.pop("settotalmass", None)
    least = {"boundmass": repr(_LEAST_MASS_KG), "boundinertia": repr(_LEAST_INERTIA_KG_M2)}
    SubElement(root, "compiler", least)
    try:
        return mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"))
    except ValueError as error:
        raise DatasetError(path, f"MuJoCo cannot compile it: {error_words(error)}") from error


def _body_path(model: Any, base: str, flange: str, path: str) -> tuple[list[int], SE3]:
    """Bodies from `base`, exclusive, to the body of `flange`, and `body_from_flange`."""
    bodies = {model.body(k).name: k for k in range(model.nbody)}
    sites = {model.site(k).name: k for k in range(model.nsite)}
    if base not in bodies:
        raise FrameNotFound(base, sorted(bodies))
    if flange not in bodies and flange not in sites:
        raise FrameNotFound(flange, sorted({*bodies, *sites}))
    is_site = flange not in bodies
    body = int(model.site_bodyid[sites[flange]]) if is_site else bodies[flange]
    tip = _pose(model.site_pos[sites[flange]], model.site_quat[sites[flange]]) if is_site else SE3.identity()
    path_bodies: list[int] = []
    while body != bodies[base]:
        if body == _WORLD_BODY:
            raise DatasetError(path, f"{flange!r} is not below {base!r}")
        path_bodies.append(body)
        body = int(model.body_parentid[body])
    return path_bodies[::-1], tip


def _is_hinge(model: Any, joint: int) -> bool:
    import mujoco

    return int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)


def _pose(translation: Array, wxyz: Array) -> SE3:
    return SE3.from_quaternion(
        np.roll(np.asarray(wxyz, dtype=np.float64), -1), np.asarray(translation, dtype=np.float64)
    )


def _gravity_direction(model: Any, base: str) -> Array:
    """Direction of gravity in the base, with z of the world up; joints above the base are at rest."""
    body, world_from_base = model.body(base).id, SE3.identity()
    while body != _WORLD_BODY:
        world_from_base = _pose(model.body_pos[body], model.body_quat[body]) @ world_from_base
        body = int(model.body_parentid[body])
    down: Array = -world_from_base.rotation[2]
    return down


def _masses(model: Any, carriers: dict[int, tuple[int, SE3]], count: int, gravity: Array) -> Masses | None:
    """Masses carried by each joint, with other joints at rest; None if a joint of the chain carries no stated mass."""
    kg, moments, carrier_of_body = np.zeros(count), np.zeros((count, 3)), dict(carriers)
    for body in range(1, model.nbody):
        if body not in carrier_of_body:
            parent = int(model.body_parentid[body])
            if parent not in carrier_of_body:
                continue
            joint, joint_from_parent = carrier_of_body[parent]
            carrier_of_body[body] = joint, joint_from_parent @ _pose(model.body_pos[body], model.body_quat[body])
        joint, joint_from_body = carrier_of_body[body]
        kg[joint] += float(model.body_mass[body])
        moments[joint] += float(model.body_mass[body]) * (joint_from_body @ np.array(model.body_ipos[body]))
    carrying = [joint for joint, _ in carriers.values()]
    if np.any(kg[carrying] <= model.nbody * _LEAST_MASS_KG):
        return None
    return Masses(kg, moments / np.where(kg > 0, kg, 1.0)[:, None], gravity)
