"""Cells of two arms whose tips touch marks or each other, and their recordings."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from basecal.cell import Cell, Recording
from basecal.cell.files import cell_from_dict, recording_from_text
from basecal.geometry import SE3, Array

BASE = "eye_base_from_hand_base"
TRUTH = SE3.from_rpy((0.02, -0.03, 3.0), (1.0, 0.1, 0.05))
TIPS = {"eye": np.array([0.02, -0.01, 0.15]), "hand": np.array([-0.03, 0.02, 0.12])}
MARKS = {
    "mark_a": np.array([0.45, -0.2, 0.02]),
    "mark_b": np.array([0.55, 0.3, 0.05]),
    "mark_c": np.array([0.3, 0.1, 0.25]),
}
_DOWN = np.diag([1.0, -1.0, -1.0])


def touch_data(names: Sequence[str] = tuple(MARKS), **more: Any) -> dict[str, Any]:
    """Data of a cell of two exact arms with a tip each, and of marks with unknown positions."""
    exact = {"noise": {"sigma_t_m": 1e-6, "sigma_r_rad": 1e-6, "kind": "total"}}
    tips = {f"{robot}_tip": {"on": robot, "offset": {"status": "free"}} for robot in TIPS}
    robots = dict.fromkeys(TIPS, exact)
    data = {"schema": "basecal/cell/1", "reference": "eye", "robots": robots, "tips": tips}
    return {**data, "marks": {name: {} for name in names}, **more}


def touch_cell(names: Sequence[str] = tuple(MARKS), **more: Any) -> Cell:
    """The cell of `touch_data`."""
    return cell_from_dict(touch_data(names, **more))


def flange_pose(rng: np.random.Generator, robot: str, tip: Array, spread: float = 0.6) -> SE3:
    """`base_from_flange` of a robot whose tip is at a world position and points down, but for a random rotation."""
    rotation = _DOWN @ SE3.from_rotvec(rng.normal(0, spread, 3), np.zeros(3)).rotation
    base = SE3.identity() if robot == "eye" else TRUTH
    return base.inverse() @ SE3(rotation, tip - rotation @ TIPS[robot])


def state(pose: SE3) -> dict[str, Any]:
    """A robot's state in the form of a line of samples.jsonl."""
    return {"base_from_flange": {"t_m": pose.translation.tolist(), "q_xyzw": pose.quaternion.tolist()}}


def touch_lines(
    rng: np.random.Generator,
    count: int,
    sigma_m: float,
    marks: Mapping[str, Array] = MARKS,
    is_stated: bool = False,
) -> list[dict[str, Any]]:
    """Lines in which the arms in turn touch the marks in turn, or each other if there are none, with noise per axis."""
    lines, names = [], list(marks)
    noise = {"sigma_m": sigma_m} if is_stated else {}
    for number in range(count):
        if names:
            robot, mark = list(TIPS)[number % 2], names[number // 2 % len(names)]
            position = marks[mark] + sigma_m * rng.standard_normal(3)
            robots = {robot: state(flange_pose(rng, robot, position))}
            observation = {"touch": mark, "tip": f"{robot}_tip"}
        else:
            position = np.array([0.5, 0, 0.4]) + rng.uniform(-0.25, 0.25, 3)
            tips = {"eye": position, "hand": position + sigma_m * rng.standard_normal(3)}
            robots = {robot: state(flange_pose(rng, robot, tip)) for robot, tip in tips.items()}
            observation = {"tip": "eye_tip", "tip2": "hand_tip"}
        lines.append({"sample": number, "robots": robots, "observations": [{**observation, **noise}]})
    return lines


SURFACES = {
    "floor": SE3.from_rotvec([0.05, -0.1, 0.0], [0.5, 0.0, 0.0]),
    "wall": SE3.from_rotvec([0.0, np.pi / 2, 0.0], [0.8, 0.0, 0.3]),
    "side": SE3.from_rotvec([np.pi / 2, 0.0, 0.3], [0.5, 0.4, 0.3]),
}


def surface_lines(
    rng: np.random.Generator, count: int, sigma_m: float, shapes: Mapping[str, str]
) -> list[dict[str, Any]]:
    """Lines in which the arms in turn touch planes and edges of `SURFACES`, and marks of shape `point`, in turn."""
    lines, free_axes = [], {"plane": [1, 1, 0], "edge": [0, 0, 1]}
    for number in range(count):
        robot, name = list(TIPS)[number % 2], list(shapes)[number // 2 % len(shapes)]
        place = (
            MARKS[name] if name in MARKS else SURFACES[name] @ (free_axes[shapes[name]] * rng.uniform(-0.25, 0.25, 3))
        )
        pose = flange_pose(rng, robot, place + sigma_m * rng.standard_normal(3))
        observation = {"touch": name, "tip": f"{robot}_tip"}
        lines.append({"sample": number, "robots": {robot: state(pose)}, "observations": [observation]})
    return lines


def surface_cell(shapes: Mapping[str, str]) -> Cell:
    """A cell of marks of these shapes, with unknown positions."""
    return touch_cell((), marks={name: {"shape": shape} for name, shape in shapes.items()})


def held_poses(
    rng: np.random.Generator, count: int, sigma_m: float = 1e-4, sigma_rad: float = 1e-3, is_hinge: bool = False
) -> list[dict[str, SE3]]:
    """`base_from_flange` of both arms while they hold a part, with noise in position and rotation of the grip."""
    ends = {robot: SE3.from_rotvec(rng.normal(0, 1.5, 3), tip) for robot, tip in TIPS.items()}
    poses = []
    for _ in range(count):
        part = SE3.from_rotvec(rng.normal(0, 0.5, 3), np.array([0.5, 0, 0.4]) + rng.uniform(-0.2, 0.2, 3))
        turn = SE3.from_rotvec([0, 0, rng.uniform(-1, 1) if is_hinge else 0.0], np.zeros(3))
        error = SE3.from_rotvec(rng.normal(0, sigma_rad, 3), rng.normal(0, sigma_m, 3))
        grips = {"eye": part, "hand": TRUTH.inverse() @ part @ error @ turn}
        poses.append({robot: grips[robot] @ ends[robot].inverse() for robot in grips})
    return poses


def clamp_lines(poses: Sequence[Mapping[str, SE3]], **sigmas: float) -> list[dict[str, Any]]:
    """Lines of the poses of `held_poses`."""
    observation = {"clamp": "part", **sigmas}
    states = ({robot: state(pose) for robot, pose in each.items()} for each in poses)
    return [{"sample": k, "robots": robots, "observations": [observation]} for k, robots in enumerate(states)]


def clamp_cell(axis: str) -> Cell:
    """A cell of two exact arms that hold a part."""
    data = touch_data((), clamp={"robots": ["eye", "hand"], "axis": axis})
    return cell_from_dict({key: data[key] for key in ("schema", "reference", "robots", "clamp")})


def recorded(cell: Cell, lines: Sequence[dict[str, Any]]) -> Recording:
    """Read lines as a recording."""
    return recording_from_text(lines_text(lines).encode(), ".", cell)


def lines_text(lines: Sequence[dict[str, Any]]) -> str:
    """Text of samples.jsonl."""
    return "".join(json.dumps(line) + "\n" for line in lines)


def write_folder(folder: Path, cell_yaml: str, lines: Sequence[dict[str, Any]]) -> Path:
    """Write a folder of a cell with its recording, and return it."""
    (folder / "recording").mkdir(parents=True)
    (folder / "cell.yaml").write_text(cell_yaml)
    (folder / "recording" / "samples.jsonl").write_text(lines_text(lines))
    return folder
