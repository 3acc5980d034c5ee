"""A cell with every kind of entry, and its recording."""

from __future__ import annotations

import json
from typing import Any

CELL = """\
schema: basecal/cell/1
reference: eye
robots:
  eye: {noise: {sigma_t_m: 1e-4, sigma_r_rad: [1e-4, 2e-4, 3e-4]}}
  hand: {urdf: hand.urdf, base_link: base, flange_link: tool0, joint_offsets: {status: prior, sigma_rad: 1e-3}}
  still:
bases:
  hand: {status: free, guess: {t_m: [1, 0, 0], rpy_deg: [0, 0, 90]}}
  still: {status: fixed, matrix: [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]}
cameras:
  wrist:
    on: eye
    model: pinhole
    size_px: [1280, 720]
    intrinsics: {status: fixed, fx: 766.5, fy: 765.4, cx: 640.9, cy: 358.8, distortion: [-0.35, 0.179, 0, 0, 0]}
  hall:
    on: world
    mount: {status: prior, t_m: [0, 0, 2], rotvec_rad: [3, 0, 0], sigma_t_m: 0.01, sigma_r_rad: [0.1, 0.1, 0.2]}
    model: fisheye
    size_px: [800, 600]
    intrinsics: {status: free}
  depth: {on: world}
targets:
  board:
    on: hand
    mount: {status: prior, t_m: [0, 0, 0.05], q_xyzw: [0, 0, 0, 1], sigma_t_m: 0.005, sigma_r_rad: 0.05}
    kind: charuco
    squares: [5, 7]
    square_m: 0.04
    marker_m: 0.03
    dictionary: DICT_4X4_50
  light: {on: hand, kind: led, mount: {status: prior, t_m: [0, 0, 0.1], sigma_t_m: 0.002}}
  tags:
    on: still
    kind: apriltag
    family: tag36h11
    tags:
      - {id: 7, size_m: 0.1, t_m: [0.2, 0, 0], q_xyzw: [0, 0, 0, 1]}
      - {id: 3, size_m: 0.05, t_m: [0, 0, 0], rpy_deg: [0, 10, 0]}
  unseen: {on: hand}
noise: {pixel_px: 0.3}
"""

URDF = """<robot name="hand"><link name="base"/><link name="upper"/><link name="tool0"/>
<joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><origin xyz="0.3 0 0"/><parent link="upper"/><child link="tool0"/>
<axis xyz="0 1 0"/></joint></robot>
"""

LINES: tuple[dict[str, Any], ...] = (
    {
        "sample": 0,
        "stamp_s": 12.5,
        "robots": {
            "eye": {"base_from_flange": {"t_m": [0.4, 0.1, 0.5], "q_xyzw": [0.6, 0.0, 0.8, 0.0]}},
            "hand": {"joints_rad": [0.1, -1.2]},
        },
        "images": {"wrist": "images/wrist/000000.png"},
        "background": {"wrist": "images/wrist/000000_off.png"},
        "observations": [
            {"camera": "wrist", "target": "board", "ids": [0, 3], "pixels": [[640.2, 360.1], [655, 360.4]]},
            {"camera": "hall", "target": "light", "pixels": [[10.5, 20.25]], "sigma_px": 0.2},
            {"camera": "wrist", "target": "light", "candidates": [[1.5, 2.5], [3.0, 4.0]], "sigma_px": [0.1, 0.2]},
        ],
    },
    {
        "sample": 1,
        "observations": [
            {
                "camera": "depth",
                "target": "unseen",
                "camera_from_target": {
                    "t_m": [0, 0, 0.8],
                    "q_xyzw": [1, 0, 0, 0],
                    "sigma_t_m": 0.001,
                    "sigma_r_rad": [0.1, 0.2, 0.3],
                },
            },
            {"camera": "depth", "target": "tags", "ids": [13], "points_in_camera_m": [[0, 0, 1]], "sigma_m": 0.001},
        ],
    },
    {"sample": 2, "robots": {"still": {"base_from_flange": {"t_m": [0, 0, 1], "rotvec_rad": [0, 0, 0.5]}}}},
)


def journal(*lines: Any) -> bytes:
    """Return the content of a journal with these lines."""
    return b"".join(json.dumps(line).encode() + b"\n" for line in lines)
