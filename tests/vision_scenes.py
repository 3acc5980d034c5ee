"""Cameras, targets and poses for tests of vision."""

from __future__ import annotations

import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array, Camera

WIDE = Camera("pinhole", np.array([766.5, 765.4, 640.9, 358.8, -0.35, 0.179, 0.0, 0.0, 0.0]), (1280, 720))
PLAIN = Camera("pinhole", np.array([500.0, 500.0, 319.5, 239.5]), (640, 480))
SMALL = Camera("pinhole", np.array([500.0, 500.0, 159.5, 119.5]), (320, 240))
FISHEYE = Camera("fisheye", np.array([420.0, 421.0, 641.0, 359.0, 0.05, -0.01, 0.002, 0.0]), (1280, 720))

TARGETS = {
    "charuco": charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50"),
    "legacy": charuco_target((5, 8), 0.035, 0.026, "DICT_5X5_100", legacy_pattern=True),
    "chessboard": chessboard_target((9, 6), 0.03),
    "circles": circles_target((8, 5), 0.03),
    "asymmetric": circles_target((4, 11), 0.02, asymmetric=True),
    "tags": apriltag_target(
        "tag36h11",
        [(3 * k + 1, 0.06, SE3.from_rpy((0, 0, 0.2 * k), (0.13 * (k % 3), 0.13 * (k // 3), 0))) for k in range(6)],
    ),
    "aruco": apriltag_target("DICT_6X6_250", [(17, 0.1, SE3.identity())]),
}


def poses(shape: Target, count: int, rng: np.random.Generator, tilt: float = 0.6) -> list[SE3]:
    """Where a target about 0.25 m wide may stand before a camera with the field of view of WIDE."""
    middle = (shape.points.max(axis=0) + shape.points.min(axis=0)) / 2
    return [_pose(middle, rng, tilt) for _ in range(count)]


def _pose(middle: Array, rng: np.random.Generator, tilt: float) -> SE3:
    rotation = SE3.from_rpy([*rng.uniform(-tilt, tilt, 2), rng.uniform(-3, 3)], np.zeros(3)).rotation
    depth = rng.uniform(0.4, 0.6)
    place = np.array([*rng.uniform(-0.12, 0.12, 2) * depth, depth])
    return SE3(rotation.copy(), place - rotation @ middle)
