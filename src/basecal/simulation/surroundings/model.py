"""MuJoCo model of a cell: every rigid part is a body whose pose is set from outside.

Everything is grey except the paper of targets, which has no blue. The colour therefore identifies the pixels of the
paper in the same image that shows its brightness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from basecal.cell import Target
from basecal.geometry import Array
from basecal.kinematics import SerialChain

TABLE_M = -0.1
"""Height of the table in the world."""

TRAY = "tray"
"""Name of the geometry that reflects an LED."""

_FLOOR_M = -0.85
_TABLE_MARGIN_M = 1.3  # from the bases to the edge of the table
_THICK_M, _THIN_M = 0.055, 0.04  # radii of an arm's first and last links
_HOUSING_FACTOR = 1.2  # radius of a joint's housing relative to its link
_PLATE_M = 0.004  # thickness of a target's plate
_LAMP_M = 0.004  # radius of an LED's body
_STEM_M = 0.05  # length of a target's holder
_TRAY_M = (0.25, 0.25, 0.003)  # half sizes
_CLUTTER_COUNT = 16
_CLUTTER_DISTANCE_M = (0.45, 1.1)  # of clutter from the line between the bases: out of the arms' way
_CLUTTER_SIZE_M = (0.03, 0.12)


@dataclass(frozen=True, eq=False)
class Stage:
    """Objects of a cell that are rendered.

    Attributes:
        chains: Kinematic chains by robot.
        bases: Positions of the bases in the world by robot, (3,) [m].
        target: The target.
        seed: Seed of the clutter.
        tray: Centre of the reflecting tray, (3,) [m]; None without a tray.
    """

    chains: Mapping[str, SerialChain]
    bases: Mapping[str, Array]
    target: Target
    seed: int
    tray: Array | None = None


def body_names(stage: Stage) -> list[str]:
    """Names of all bodies whose poses are set: the base and each joint of each arm, then the target."""
    return [*(f"{robot}/{k}" for robot, chain in stage.chains.items() for k in range(chain.n + 1)), "target"]


def mjcf(stage: Stage, size_px: tuple[int, int], fovy_deg: float) -> str:
    """The model in MuJoCo's XML format, with a camera `eye` of a given image size and field of view."""
    width, height = size_px
    arms = "".join(_arm(robot, chain) for robot, chain in stage.chains.items())
    return f"""
<mujoco>
  <statistic extent="1" center="0 0 0"/>
  <visual>
    <global offwidth="{width}" offheight="{height}" fovy="{fovy_deg!r}"/>
    <quality offsamples="4" shadowsize="1024"/>
    <map znear="0.01" zfar="20"/>
    <headlight ambient="0.45 0.45 0.45" diffuse="0.3 0.3 0.3" specular="0 0 0"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".55 .55 .55" rgb2=".25 .25 .25" width="64" height="64"/>
    <texture name="grain" type="2d" builtin="checker" rgb1=".34 .34 .34" rgb2=".42 .42 .42" width="64" height="64"/>
    <material name="table" texture="grain" texrepeat="12 12" specular="0"/>
    <material name="metal" rgba=".62 .62 .62 1" specular="0"/>
    <material name="joint" rgba=".3 .3 .3 1" specular="0"/>
    <material name="paper" rgba=".95 .95 0 1" specular="0"/>
  </asset>
  <worldbody>
    <light pos=".6 -.8 2.4" dir="0.1 0.3 -1" diffuse=".5 .5 .5" specular="0 0 0" directional="true" castshadow="false"/>
    {_table(stage)}
    {_clutter(stage)}
    {arms}
    <body name="target" mocap="true">{_target(stage.target)}</body>
    <body name="eye" mocap="true"><camera name="eye" fovy="{fovy_deg!r}" quat="0 1 0 0"/></body>
  </worldbody>
</mujoco>"""


def _table(stage: Stage) -> str:
    places = np.array([*stage.bases.values(), np.zeros(3)])
    low, high = places.min(0)[:2] - _TABLE_MARGIN_M, places.max(0)[:2] + _TABLE_MARGIN_M
    middle, half = (low + high) / 2, (high - low) / 2
    top = f'<geom type="box" material="table" pos="{_text([*middle, TABLE_M - 0.02])}" '
    floor = f'<geom type="plane" pos="0 0 {_FLOOR_M}" size="9 9 1" rgba=".3 .3 .3 1"/>'
    tray = ""
    if stage.tray is not None:
        under = _text(stage.tray - [0.0, 0.0, _TRAY_M[2]])
        tray = f'<geom name="{TRAY}" type="box" material="joint" pos="{under}" size="{_text(_TRAY_M)}"/>'
    return f'{top} size="{_text([*half, 0.02])}"/>{floor}{tray}'


def _clutter(stage: Stage) -> str:
    """Boxes, cylinders and spheres on the table, out of the arms' way."""
    rng = np.random.default_rng([stage.seed, 23])
    places = np.array([*stage.bases.values(), np.zeros(3)])
    along = places.max(0)[0] + 0.8
    things = []
    for _ in range(_CLUTTER_COUNT):
        kind = ("box", "cylinder", "sphere")[rng.integers(3)]
        size = rng.uniform(*_CLUTTER_SIZE_M, 3)
        height = {"box": size[2], "cylinder": size[1], "sphere": size[0]}[kind]
        at = [rng.uniform(-0.5, along), rng.choice([-1, 1]) * rng.uniform(*_CLUTTER_DISTANCE_M), TABLE_M + height]
        grey = rng.uniform(0.1, 0.9)
        things.append(
            f'<geom type="{kind}" pos="{_text(at)}" size="{_text(size)}" rgba="{_text([grey] * 3)} 1" '
            f'euler="0 0 {rng.uniform(0, 90):.1f}"/>'
        )
    return "".join(things)


def _arm(robot: str, chain: SerialChain) -> str:
    """Bodies of an arm's base and of each joint frame, with the link to the next joint and the joint's housing."""
    bodies = []
    for k in range(chain.n + 1):
        radius = _THICK_M + (_THIN_M - _THICK_M) * k / chain.n
        ahead = chain.origins[k].translation if k < chain.n else chain.tip.translation
        shapes = _rod(np.zeros(3), ahead, radius, "metal")
        if k:
            half = _HOUSING_FACTOR * radius * chain.axes[k - 1]
            shapes += _rod(-half, half, _HOUSING_FACTOR * radius, "joint", "cylinder")
        bodies.append(f'<body name="{robot}/{k}" mocap="true">{shapes}</body>')
    return "".join(bodies)


def _rod(start: Array, end: Array, radius: float, material: str, kind: str = "capsule") -> str:
    """A rod between two points; a sphere if they coincide."""
    if np.linalg.norm(end - start) < 1e-4:
        return f'<geom type="sphere" pos="{_text(start)}" size="{radius}" material="{material}"/>'
    return f'<geom type="{kind}" fromto="{_text([*start, *end])}" size="{radius}" material="{material}"/>'


def _target(target: Target) -> str:
    """Plates with the paper on their front and a stem on their back; for LEDs, their bodies."""
    if not target.sheets:
        return "".join(
            f'<geom type="sphere" pos="{_text(point)}" size="{_LAMP_M}" material="joint"/>' for point in target.points
        )
    shapes = []
    for sheet in target.sheets:
        left, top, right, bottom = sheet.paper
        at, behind = sheet.target_from_sheet, np.array([0.0, 0.0, 1.0])
        middle = np.array([(left + right) / 2, (top + bottom) / 2, 0.0])
        half = [(right - left) / 2, (bottom - top) / 2, _PLATE_M / 2]
        turn, centre = _text(at.rotation[:, :2].T), _text(at @ (middle + _PLATE_M / 2 * behind))
        shapes.append(f'<geom type="box" pos="{centre}" size="{_text(half)}" xyaxes="{turn}" material="paper"/>')
        stem = at @ (middle + _PLATE_M * behind), at @ (middle + _STEM_M * behind)
        shapes.append(_rod(*stem, 0.5 * _THIN_M, "joint", "cylinder"))
    return "".join(shapes)


def _text(numbers: object) -> str:
    return " ".join(repr(float(value)) for value in np.asarray(numbers, dtype=np.float64).ravel())
