"""Text of a new `cell.yaml` with comments on every field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from json import dumps
from textwrap import dedent
from typing import Any, Literal

import numpy as np

from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.geometry.lenses.registry import lens_models, terms_text

Kind = Literal[TargetKindName, "pose"]

_HEADER_LINES = """\
# What exists in the cell, what is known of it, and what is requested. Lengths in m, angles in rad unless the key says
# otherwise. A transform a_from_b is the pose of b in a. Each has a status: free (requested), prior (with sigma_t_m and
# sigma_r_rad) or fixed. A pose has t_m and one of q_xyzw, rotvec_rad, rpy_deg; or is a 4x4 matrix.
schema: basecal/cell/1
"""
_ROBOT_HELP = """\
robots:                              # by recorded flange poses; for joints: {urdf: .., base_link: .., flange_link: ..}
"""
_NOISE_HELP = "# optional: {noise: {sigma_t_m: 1e-4, sigma_r_rad: 1e-4}}, of its recorded pose, per axis"


def cell_text(
    robots: int | Sequence[str], kind: Kind, camera_on_world: bool = False, shape: Mapping[str, Any] | None = None
) -> str:
    """Create the text of a `cell.yaml` to fill in.

    Args:
        robots: Number or names of the robots. A single robot observes a target on the world; of several robots, each
            observes the target on the next one.
        kind: Kind of the targets, each with distinct marks; `pose` for targets whose pose another program measures.
        camera_on_world: Whether the camera is fixed to the world and a single robot carries the target.
        shape: Fields of the targets, with their kind; those of an example if None.
    """
    given = robot_names(robots) if isinstance(robots, int) else list(robots)
    names = ["hand"] if camera_on_world else given
    # Carriers of each camera and of its target.
    single = ("world", names[0]) if camera_on_world else (names[0], "world")
    pairs = list(pairwise(names)) if len(names) > 1 else [single]
    parts = [
        _HEADER_LINES,
        f"reference: {names[0]:<26}# this robot's base is `world`: where everything is expressed\n",
        _ROBOT_HELP,
    ]
    parts += [f"  {name + ': {}':<35}{_NOISE_HELP if name == names[0] else ''}".rstrip() + "\n" for name in names]
    parts += ["bases:\n"] if len(names) > 1 else []
    for name in names[1:]:
        comment = f"{names[0]}_base_from_{name}_base; free is the default; `guess: {{...}}` is optional"
        parts.append(f"{f'  {name}: {{status: free}}':<37}# {comment}\n")
    parts += [
        "cameras:\n",
        *(_camera(_numbered_name("camera", i), on, names[0], kind) for i, (on, _) in enumerate(pairs)),
    ]
    targets = [(_numbered_name("target", i), on) for i, (_, on) in enumerate(pairs)]
    parts += ["targets:\n"]
    parts += [
        f"  {name}:\n{_mount(on, names[0], name)}{_fields(kind, shape, i)}" for i, (name, on) in enumerate(targets)
    ]
    parts += (
        []
        if kind == "pose"
        else ["# noise: {pixel_px: 0.3}           # per coordinate; estimated from the residuals where absent\n"]
    )
    return "".join(parts)


def robot_names(robots: int) -> list[str]:
    """Names of the robots of a new cell."""
    return ["eye", "hand", *(f"arm{i}" for i in range(3, robots + 1))][:robots]


def _numbered_name(name: str, index: int) -> str:
    return name if index == 0 else f"{name}{index + 1}"


def _mount(carrier: str, reference: str, name: str) -> str:
    parent = f"{reference}_base" if carrier == "world" else f"{carrier}_flange"
    carrier_line = f"    on: {carrier:<29}# a robot (its flange) or `world`\n"
    return f"{carrier_line}    mount: {{status: free}}            # {parent}_from_{name}\n"


def _camera(name: str, carrier: str, reference: str, kind: Kind) -> str:
    text = f"  {name}:\n{_mount(carrier, reference, name)}"
    if kind == "pose":
        return text
    text += f"    model: pinhole                   # {' or '.join(f'{m} ({terms_text(m)})' for m in lens_models())}\n"
    text += "    size_px: [1280, 720]             # width, height of its images\n"
    # A target of one point does not determine the intrinsics.
    if not TARGETS[kind].usual(np.random.default_rng(0)).is_point:
        return text + "    intrinsics: {status: free}       # or fixed / prior with fx, fy, cx, cy, distortion\n"
    known = "{status: fixed, fx: 1000, fy: 1000, cx: 639.5, cy: 359.5, distortion: [0, 0, 0, 0, 0]}"
    advice = "# Put your camera's numbers here: a single LED does not determine them."
    return text + f"    {advice}\n    intrinsics: {known}\n"


def _fields(kind: Kind, shape: Mapping[str, Any] | None, index: int) -> str:
    """Lines of a target by its index; the first one has comments, if no shape is given."""
    if kind == "pose":
        return ""
    known = TARGETS[kind]
    if shape is None and index == 0:
        return known.template
    fields = known.numbered_fields(shape or parse_yaml(dedent(known.template), kind).data, index)
    plain = {key: value if isinstance(value, str) else dumps(value) for key, value in fields.items()}
    return "".join(f"    {key}: {value}\n" for key, value in plain.items())
