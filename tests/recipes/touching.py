"""Raw files of the recipes without a camera: touches of marks, sockets and tips, and tracker measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.geometry import SE3
from tests.touch_cells import MARKS, flange_pose, held_poses

SIGMA_M = 1e-4
SOCKETS = {"socket_1": np.array([0.4, 0.1, 0.2]), "socket_2": np.array([0.7, 0.1, 0.2])}
SOCKET_CELL = """schema: basecal/cell/1
reference: arm
robots:
  arm: {}
marks:
  plate: {points_m: {socket_1: [0, 0, 0], socket_2: [0.3, 0, 0]}, sigma_m: 2e-5}
"""
MEETING_CELL = """schema: basecal/cell/1
reference: left
robots:
  left: {}
tips:
  left_tip: {on: left}
"""


def table(path: Path, notation: str, poses: Sequence[SE3], marks: Sequence[str] = ()) -> None:
    """Write poses like a controller, with an optional column of marks."""
    how = CONTROLLERS[notation]
    heads = [*(["mark"] if marks else []), *how.names]
    rows = [[f"{value:.10g}" for value in row] for row in how.to_numbers(SE3.stack(list(poses)))]
    rows = [[mark, *row] for mark, row in zip(marks, rows, strict=True)] if marks else rows
    path.write_text("\n".join(",".join(row) for row in [heads, *rows]) + "\n")


def touches(folder: Path) -> None:
    """Touches of three marks by two arms, of two tips by each other, and of two sockets by one arm."""
    rng, names = np.random.default_rng(0), [list(MARKS)[k % 3] for k in range(15)]
    for robot, name, notation in (("eye", "left", "kuka"), ("hand", "right", "ur")):
        places = [MARKS[mark] + SIGMA_M * rng.standard_normal(3) for mark in names]
        table(folder / f"{name}.txt", notation, [flange_pose(rng, robot, at) for at in places], names)
    met = np.array([0.5, 0.0, 0.4]) + rng.uniform(-0.25, 0.25, (20, 3))
    for robot, name in (("eye", "left"), ("hand", "right")):
        places = met + SIGMA_M * rng.standard_normal((20, 3))
        table(folder / f"met_{name}.csv", "ros", [flange_pose(rng, robot, at) for at in places])
    sockets = [list(SOCKETS)[k % 2] for k in range(16)]
    places = [SOCKETS[mark] + SIGMA_M * rng.standard_normal(3) for mark in sockets]
    table(folder / "sockets.csv", "ros", [flange_pose(rng, "eye", at) for at in places], sockets)
    for robot, name in (("eye", "left"), ("hand", "right")):
        table(folder / f"held_{name}.csv", "ros", [poses[robot] for poses in held_poses(np.random.default_rng(2), 20)])
    for name, text in (("socketcell", SOCKET_CELL), ("meetings", MEETING_CELL)):
        (folder / name).mkdir()
        (folder / name / "cell.yaml").write_text(text)


def tracker(folder: Path) -> None:
    """Poses of an arm, and a tracker's measurements of two reflectors at each."""
    rng, world_from_tracker = np.random.default_rng(1), SE3.from_rpy((0.3, -0.2, 1.0), (3.0, 1.0, 0.5))
    poses = [flange_pose(rng, "eye", np.array([0.5, 0.0, 0.4]) + rng.uniform(-0.3, 0.3, 3)) for _ in range(15)]
    table(folder / "arm.csv", "ur", poses)
    lines = ["target,sample,x_mm,y_mm,z_mm"]
    for number, pose in enumerate(poses):
        for name, place in (("top", [0.05, 0.0, 0.1]), ("side", [0.0, 0.1, 0.02])):
            point = world_from_tracker.inverse() @ (pose @ np.array(place)) + 2e-5 * rng.standard_normal(3)
            lines.append(",".join([name, str(number), *(f"{1e3 * value:.5f}" for value in point)]))
    (folder / "tracker.csv").write_text("\n".join(lines) + "\n")
