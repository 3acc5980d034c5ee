"""A cell of two arms without a target: renders what their wrist cameras see of a table, a wall and boxes.

Usage: python examples/scene/make.py FOLDER [--views 15] [--size 640x480] [--seed 1]. Writes cell.yaml, the recording
with images, and truth.yaml.
"""

from __future__ import annotations

import argparse
import json
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from basecal.geometry import SE3, Camera

MOUNTS = SE3.from_rpy((0.05, -0.1, 0.3), (0.04, -0.02, 0.08)), SE3.from_rpy((-0.04, 0.08, -1.2), (0.02, 0.03, 0.07))
LEFT_BASE_FROM_RIGHT_BASE = SE3.from_rpy((0.01, 0.02, 2.9), (1.4, 0.1, 0.05))
ARM_M, ARM_RAD = 2e-4, 3e-4  # pose errors of both arms, 1 sigma per axis
DISTORTION = [-0.05, 0.02, 0, 0, 0]
GREY_LEVELS = 1.5  # noise of images, 1 sigma
MIDDLE = np.array([0.7, 0.0, 0.0])
# Faces of boxes, the table and a wall: a corner, two sides [m], all in the base of the left robot.
FACES = [
    ((-0.6, -1.5, 0.0), (2.6, 0, 0), (0, 3.0, 0)),
    ((-0.6, 1.2, 0.0), (2.6, 0, 0), (0, 0, 1.6)),
    ((0.55, -0.35, 0.12), (0.2, 0.05, 0), (-0.04, 0.16, 0)),
    ((0.55, -0.35, 0.0), (0.2, 0.05, 0), (0, 0, 0.12)),
    ((0.75, 0.15, 0.2), (0.16, -0.06, 0), (0.06, 0.16, 0)),
    ((0.75, 0.15, 0.0), (0.06, 0.16, 0), (0, 0, 0.2)),
]
TEXELS_PER_M = 700


def texture(rng: np.random.Generator, shape: tuple[int, int], contrast: float) -> np.ndarray:
    """Grey levels (h, w) of blots of many sizes."""
    level = np.zeros(shape, dtype=np.float32)
    for size in (3, 8, 20, 60):
        small = rng.standard_normal((shape[0] // size + 2, shape[1] // size + 2)).astype(np.float32)
        level += cv2.resize(small, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC) * (0.5 + 0.1 * size) ** 0.5
    return np.clip(128 + contrast * 60 * level / level.std(), 0, 255).astype(np.uint8)


def textures(seed: int, contrast: float = 1.0) -> list[np.ndarray]:
    """A texture for each face."""
    rng = np.random.default_rng(seed)
    sizes = [[int(TEXELS_PER_M * np.linalg.norm(side)) for side in (b, a)] for _, a, b in FACES]
    return [texture(rng, (max(h, 32), max(w, 32)), contrast) for h, w in sizes]


@lru_cache(maxsize=4)
def directions(lens: Camera) -> np.ndarray:
    """Direction of each pixel in the camera, (w * h, 3)."""
    assert lens.size_px is not None
    width, height = lens.size_px
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2).astype(float)
    return lens.undistort(pixels)[0]


def render_image(
    world_from_camera: SE3, lens: Camera, faces: list[tuple], painted: list[np.ndarray], rng: np.random.Generator
) -> np.ndarray:
    """What a camera sees of faces and what is painted on them, (h, w) of grey levels."""
    assert lens.size_px is not None
    width, height = lens.size_px
    rays = directions(lens) @ world_from_camera.rotation.T
    centre = world_from_camera.translation
    nearest, level = np.full(len(rays), np.inf), np.full(len(rays), 90.0, dtype=np.float32)
    for (corner, side, other), image in zip(faces, painted, strict=True):
        a, b = np.array(side, dtype=float), np.array(other, dtype=float)
        normal = np.cross(a, b)
        with np.errstate(all="ignore"):
            depth = ((np.array(corner) - centre) @ normal) / (rays @ normal)
        at = centre + depth[:, None] * rays - corner
        u, v = at @ a / (a @ a), at @ b / (b @ b)
        hit = (depth > 0.05) & (depth < nearest) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        if not hit.any():
            continue
        h, w = image.shape
        column, row = (u * (w - 1)).astype(np.float32), (v * (h - 1)).astype(np.float32)
        seen = cv2.remap(image, column.reshape(height, width), row.reshape(height, width), cv2.INTER_LINEAR).ravel()
        level[hit], nearest[hit] = seen[hit], depth[hit]
    noisy = level + GREY_LEVELS * rng.standard_normal(len(level))
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8).reshape(height, width)


def looks(rng: np.random.Generator, count: int, side: float) -> list[SE3]:
    """Poses of a camera that looks at the middle of the table from one side."""
    poses = []
    for _ in range(count):
        place = MIDDLE + np.array([side * rng.uniform(0.0, 0.35), rng.uniform(-0.35, 0.35), rng.uniform(0.5, 0.85)])
        z = MIDDLE + rng.uniform(-0.15, 0.15, 3) - place
        z /= np.linalg.norm(z)
        up = np.array([rng.normal(0, 0.4), 1.0, rng.normal(0, 0.2)])
        x = np.cross(up, z)
        x /= np.linalg.norm(x)
        poses.append(SE3(np.column_stack([x, np.cross(z, x), z]), place))
    return poses


def pose(transform: SE3) -> dict[str, list[float]]:
    """A pose as files hold it."""
    return {"t_m": transform.translation.tolist(), "q_xyzw": transform.quaternion.tolist()}


def make(
    folder: Path, views: int = 15, size: tuple[int, int] = (640, 480), seed: int = 1, contrast: float = 1.0
) -> None:
    """Write the cell."""
    rng = np.random.default_rng(seed)
    width, height = size
    focal, centre = 0.8 * width, ((width - 1) / 2, (height - 1) / 2)
    lens = Camera("pinhole", np.array([focal, focal, *centre, *DISTORTION]), size)
    painted = textures(seed, contrast)
    lines, sample = [], 0
    bases = SE3.identity(), LEFT_BASE_FROM_RIGHT_BASE
    for arm, (name, base, mount) in enumerate(zip(("left", "right"), bases, MOUNTS, strict=True)):
        (folder / f"recording/images/{name}_eye").mkdir(parents=True, exist_ok=True)
        for world_from_camera in looks(rng, views, -1.0 if arm == 0 else 1.0):
            path = f"images/{name}_eye/{sample:06d}.png"
            cv2.imwrite(str(folder / "recording" / path), render_image(world_from_camera, lens, FACES, painted, rng))
            recorded = base.inverse() @ world_from_camera @ mount.inverse()
            recorded = recorded @ SE3.exp(rng.standard_normal(6) * np.repeat([ARM_M, ARM_RAD], 3))
            robots = {name: {"base_from_flange": pose(recorded)}}
            lines.append(json.dumps({"sample": sample, "robots": robots, "images": {f"{name}_eye": path}}))
            sample += 1
    (folder / "recording/samples.jsonl").write_text("\n".join(lines) + "\n")
    stated = f"{{status: fixed, fx: {focal}, fy: {focal}, cx: {centre[0]}, cy: {centre[1]}, distortion: {DISTORTION}}}"
    cameras = "".join(
        f"  {name}_eye: {{on: {name}, model: pinhole, size_px: [{width}, {height}], intrinsics: {stated}}}\n"
        for name in ("left", "right")
    )
    head = "schema: basecal/cell/1\nreference: left\ntarget: scene\nrobots: {left: {}, right: {}}\n"
    (folder / "cell.yaml").write_text(f"{head}cameras:\n{cameras}")
    names = {
        "left_base_from_right_base": LEFT_BASE_FROM_RIGHT_BASE,
        "left_flange_from_left_eye": MOUNTS[0],
        "right_flange_from_right_eye": MOUNTS[1],
    }
    truth = "".join(f"  {name}: {json.dumps(pose(value))}\n" for name, value in names.items())
    (folder / "truth.yaml").write_text(f"schema: basecal/truth/1\ntransforms:\n{truth}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--views", type=int, default=15)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--contrast", type=float, default=1.0)
    asked = parser.parse_args()
    w, h = map(int, asked.size.split("x"))
    make(asked.folder, asked.views, (w, h), asked.seed, asked.contrast)
