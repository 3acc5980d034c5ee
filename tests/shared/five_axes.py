"""Two hobby arms of five axes, such as SO-101, with a camera on one wrist and a small dotted board on the other.

Lengths are about those of the SO-101. Such an arm reaches hardly any pose with six degrees of freedom, and looks from
less than 0.2 m. The joint offsets are some degrees, and joints stop within 0.1 deg of their commanded positions.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3, Array
from basecal.kinematics.chain import SerialChain

BASE = "left_base_from_right_base"
OFFSET_DEG, STOP_DEG, PIXEL_PX = 1.5, 0.1, 0.3
FOCAL_PX, SIZE_PX = 500.0, np.array([640, 480])
BOARD_M = np.array([[0.012 * x - 0.036, 0.012 * y - 0.024, 0.0] for y in range(5) for x in range(7)])
LEFT_FLANGE_FROM_WRIST = SE3.from_rpy((-np.pi / 2 - 0.5, 0, -np.pi / 2), (-0.05, 0.01, 0.06))
RIGHT_FLANGE_FROM_BOARD = SE3.from_rpy((0.1, np.pi / 2, 0), (0.02, 0, 0.01))
NEAREST_M, FARTHEST_M = 0.12, 0.3


def five_axis_arm() -> SerialChain:
    """An arm with pan, lift, elbow and wrist joints, then a roll about the forearm."""
    names = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
    places = np.array([[0.039, 0, 0.062], [0.030, 0, 0.054], [0.028, 0, 0.113], [0.135, 0, 0.005], [0.061, 0, 0]])
    axes = np.array([[0, 0, 1.0], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]])
    limits = np.radians([90.0, 75, 75, 90, 150])
    return SerialChain(names, SE3(np.tile(np.eye(3), (5, 1, 1)), places), axes, SE3(np.eye(3), np.array([0.098, 0, 0])),
                       -limits, limits)  # fmt: skip


ARM = five_axis_arm()


def write_five_axis_cell(folder: Path, seed: int, samples: int = 30) -> SE3:
    """Write a cell and its recording, with priors on joint offsets, and return the true base of the right arm."""
    rng = np.random.default_rng([seed, 5])
    base = SE3.from_rpy((0, 0, np.pi * 0.9 + rng.uniform(-0.3, 0.3)), np.array([0.5, 0.05, 0]) + rng.normal(0, 0.02, 3))
    recorded = _facing_joints(base, samples, rng)
    true = [q + np.radians(rng.normal(0, OFFSET_DEG, 5) + rng.normal(0, STOP_DEG, q.shape)) for q in recorded]
    image_points = _pixels(base, *true) + rng.normal(0, PIXEL_PX, (samples, len(BOARD_M), 2))
    lines = [
        {"robots": _states(left=left, right=right), "observations": [_view("wrist", pixels)]}
        for left, right, pixels in zip(*recorded, image_points, strict=True)
    ]
    _write(folder, {"wrist": "left"}, "right", lines)
    return base


def write_board_between(folder: Path, seed: int, samples: int = 20) -> SE3:
    """Write a cell with a camera on each wrist and a board on the table, and return the true base."""
    rng = np.random.default_rng([seed, 6])
    base = SE3.from_rpy((0, 0, rng.uniform(-0.2, 0.2)), (0, -0.4, 0))
    world_from_board = SE3.from_rpy((0, 0, 0.3), (0.25, -0.2, 0))
    lines = list[dict[str, object]]()
    for name, arm_base in (("left", SE3.identity()), ("right", base)):
        board_in_base = arm_base.inverse() @ world_from_board
        recorded = _joints_over_board(board_in_base, samples, rng)
        true_joints = recorded + np.radians(rng.normal(0, OFFSET_DEG, 5) + rng.normal(0, STOP_DEG, recorded.shape))
        image_points = _project((ARM.forward(true_joints) @ LEFT_FLANGE_FROM_WRIST).inverse() @ board_in_base)
        image_points += rng.normal(0, PIXEL_PX, image_points.shape)
        lines += [
            {"robots": _states(**{name: q}), "observations": [_view(f"{name}_wrist", px)]}
            for q, px in zip(recorded, image_points, strict=True)
        ]
    _write(folder, {"left_wrist": "left", "right_wrist": "right"}, "world", lines)
    return base


def _write(folder: Path, cameras: dict[str, str], board_on: str, lines: list[dict[str, object]]) -> None:
    (folder / "recording").mkdir(parents=True)
    (folder / "arm.urdf").write_text(chain_urdf(ARM, "base_link", "gripper_link"))
    offsets = {"status": "prior", "sigma_rad": float(np.radians(2.0))}
    robot = {"urdf": "arm.urdf", "base_link": "base_link", "flange_link": "gripper_link", "joint_offsets": offsets}
    cx, cy = (SIZE_PX / 2).tolist()
    lens = {"status": "fixed", "fx": FOCAL_PX, "fy": FOCAL_PX, "cx": cx, "cy": cy, "distortion": []}
    cell = {
        "schema": "basecal/cell/1",
        "reference": "left",
        "robots": {"left": robot, "right": robot},
        "cameras": {n: {"on": on, "size_px": SIZE_PX.tolist(), "intrinsics": lens} for n, on in cameras.items()},
        "targets": {"board": {"on": board_on, "kind": "points", "points_m": BOARD_M.tolist()}},
    }
    (folder / "cell.yaml").write_text(json.dumps(cell))
    rows = (json.dumps({"sample": number, **line}) for number, line in enumerate(lines))
    (folder / "recording/samples.jsonl").write_text("".join(f"{line}\n" for line in rows))


def _states(**joints: Array) -> dict[str, object]:
    return {name: {"joints_rad": q.tolist()} for name, q in joints.items()}


def _view(camera: str, pixels: Array) -> dict[str, object]:
    return {"camera": camera, "target": "board", "ids": list(range(len(BOARD_M))), "pixels": pixels.tolist()}


def _joints_over_board(base_from_board: SE3, samples: int, rng: np.random.Generator) -> Array:
    """Joints of an arm whose camera has the whole board in the image, (samples, 5)."""
    chosen = np.zeros((0, 5))
    while len(chosen) < samples:
        drawn = rng.uniform(0.9 * ARM.lower, 0.9 * ARM.upper, (4000, 5))
        eye = ARM.forward(drawn) @ LEFT_FLANGE_FROM_WRIST
        board_in_camera = np.einsum("nji,nj->ni", eye.rotation, base_from_board.translation - eye.translation)
        drawn = drawn[
            (board_in_camera[:, 2] > NEAREST_M)
            & (board_in_camera[:, 2] < 2 * FARTHEST_M)
            & (eye.translation[:, 2] > 0.03)
        ]
        pixels = _project((ARM.forward(drawn) @ LEFT_FLANGE_FROM_WRIST).inverse() @ base_from_board)
        inside = ((pixels > 5) & (pixels < SIZE_PX - 5)).all((1, 2))
        chosen = np.concatenate([chosen, drawn[inside]])
    return chosen[:samples]


def _facing_joints(base: SE3, samples: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Joints of both arms with the whole board in the image, (samples, 5) each."""
    found: list[tuple[Array, Array]] = []
    while len(found) < samples:
        left, right = rng.uniform(0.9 * ARM.lower, 0.9 * ARM.upper, (2, 1000, 5))
        eye = ARM.forward(left) @ LEFT_FLANGE_FROM_WRIST
        board = base @ ARM.forward(right) @ RIGHT_FLANGE_FROM_BOARD
        offsets = board.translation - eye.translation[:, None]
        distance = np.linalg.norm(offsets, axis=-1)
        ahead = np.einsum("ijk,ik->ij", offsets, eye.rotation[..., 2]) / distance
        facing = np.abs(np.einsum("ijk,jk->ij", offsets, board.rotation[..., 2])) / distance
        near = (distance > NEAREST_M) & (distance < FARTHEST_M) & (ahead > 0.93) & (facing > 0.5)
        for row, column in {row: (row, column) for row, column in np.argwhere(near)}.values():
            pixels = _pixels(base, left[row, None], right[column, None])
            if ((pixels > 5) & (pixels < SIZE_PX - 5)).all():
                found.append((left[row], right[column]))
    lefts, rights = (np.stack(each[:samples]) for each in zip(*found, strict=True))
    return lefts, rights


def _pixels(base: SE3, left: Array, right: Array) -> Array:
    """Pixels of the board's points, (n, points, 2)."""
    eye = ARM.forward(left) @ LEFT_FLANGE_FROM_WRIST
    camera_from_board = eye.inverse() @ base @ ARM.forward(right) @ RIGHT_FLANGE_FROM_BOARD
    return _project(camera_from_board)


def _project(camera_from_board: SE3) -> Array:
    points = BOARD_M @ camera_from_board.rotation.mT + camera_from_board.translation[:, None]
    return np.asarray(FOCAL_PX * points[..., :2] / points[..., 2:] + SIZE_PX / 2)
