"""Cameras, targets and poses for tests of vision."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detection import Detection, Image
from basecal.vision.draw.render import RenderSettings, render

WIDE = Camera("pinhole", np.array([766.5, 765.4, 640.9, 358.8, -0.35, 0.179, 0.0, 0.0, 0.0]), (1280, 720))
PLAIN = Camera("pinhole", np.array([500.0, 500.0, 319.5, 239.5]), (640, 480))
SMALL = Camera("pinhole", np.array([500.0, 500.0, 159.5, 119.5]), (320, 240))
FISHEYE = Camera("fisheye", np.array([420.0, 421.0, 641.0, 359.0, 0.05, -0.01, 0.002, 0.0]), (1280, 720))

STRAIGHT = SE3.from_rpy((0.2, -0.15, 0.3), (0.01, 0.02, 0.5))

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
    """Draw poses at which a camera like WIDE sees a target about 0.25 m wide."""
    middle = (shape.points.max(axis=0) + shape.points.min(axis=0)) / 2
    return [_pose(middle, rng, tilt) for _ in range(count)]


def _pose(middle: Array, rng: np.random.Generator, tilt: float) -> SE3:
    rotation = SE3.from_rpy([*rng.uniform(-tilt, tilt, 2), rng.uniform(-3, 3)], np.zeros(3)).rotation
    depth = rng.uniform(0.4, 0.6)
    position = np.array([*rng.uniform(-0.12, 0.12, 2) * depth, depth])
    return SE3(rotation.copy(), position - rotation @ middle)


@lru_cache(maxsize=32)
def scene(shape: Target, settings: RenderSettings | None = None, pose: SE3 = STRAIGHT) -> Image:
    """Render a target half a metre ahead of WIDE, slightly tilted; the image is cached and read-only."""
    image = render(WIDE, shape, at(shape, pose), settings)
    image.setflags(write=False)
    return image


def at(shape: Target, pose: SE3 = STRAIGHT) -> SE3:
    """Return the pose of a target whose middle is at a pose."""
    middle = (shape.points.max(axis=0) + shape.points.min(axis=0)) / 2
    return SE3(pose.rotation, pose.translation - pose.rotation @ middle)


DARK = RenderSettings(black=2, white=9, background=5, noise=0.3)
BLURRED = RenderSettings(blur_px=3.0, noise=1.0)


def shrunk(image: Image, block: int) -> Image:
    """Return the image with each block of pixels averaged to one."""
    height, width = (side // block for side in image.shape)
    blocks = image[: height * block, : width * block].reshape(height, block, width, block)
    return np.rint(blocks.mean(axis=(1, 3))).astype(np.uint8)


def errors_of(detection: Detection | None, shape: Target, block: int = 1) -> Array:
    """Errors of a detection in a `scene`, (n, 2) [px]; a symmetric grid is matched in its better order."""
    assert detection is not None
    assert detection.ids is not None
    true = (WIDE.project(at(shape) @ shape.points) + 0.5) / block - 0.5
    rows = shape.rows(detection.ids)
    candidates = [
        detection.pixels - each[rows] for each in ((true, true[::-1]) if shape.has_half_turn_symmetry else (true,))
    ]
    return min(candidates, key=lambda each: float(np.abs(each).max()))


def with_exif(jpeg: bytes, orientation: int, order: str = "<") -> bytes:
    """A JPEG with an EXIF segment that states an orientation."""
    tiff = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(
        order + "IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0
    )
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(tiff) + 8) + b"Exif\0\0" + tiff + jpeg[2:]


def check_poor_image(
    detect: Callable[[Image, Target], Detection | None], shape: Target, settings: RenderSettings, block: int, count: int
) -> None:
    """Check that a target is found with at least `count` points, and that sigmas are true within a factor of 2.5."""
    detection = detect(shrunk(scene(shape, settings), block), shape)
    error = errors_of(detection, shape, block)
    assert detection is not None
    assert len(error) >= count
    assert 0.4 < np.sqrt(np.mean((error / detection.sigma_px[:, None]) ** 2)) < 2.5
