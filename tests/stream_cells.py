"""Streams of an arm with a wrist camera that moves smoothly in front of a tag; each stream has its own clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.cell import (
    Cell,
    CellCamera,
    CellTarget,
    Clock,
    Intrinsics,
    PixelObservation,
    PoseObservation,
    Recording,
    Robot,
    RobotState,
    RollingShutter,
    Sample,
    Target,
)
from basecal.cell.targets.points import points_target
from basecal.geometry import SE3, Array, Camera

HOME = SE3.exp(np.array([0.4, 0.1, 0.6, 0.2, 2.9, 0.1]))
MOUNT = SE3.exp(np.array([0.03, -0.02, 0.08, 0.1, -0.1, 0.4]))  # flange from camera
TAG = SE3.exp(np.array([0.5, 0.0, 0.02, 0.0, 0.0, 0.3]))  # base from tag
BOARD = HOME @ MOUNT @ SE3.exp(np.array([0.0, 0.0, 1.0, 0.2, -0.1, 0.1]))  # base from a board before the camera
SIGMA = np.repeat([5e-4, 1e-3], 3)  # of a measured pose [m, rad]
RATE_HZ, VIEW_RATE_HZ = 50.0, 10.0  # of records and views


@dataclass(frozen=True, eq=False)
class Streamed:
    """A cell, its recording, and the true offset of the camera's clock [s]."""

    cell: Cell
    recording: Recording
    offset_s: float


def path_poses(times: Array) -> SE3:
    """Poses `base_from_flange` at instants [s]: a path whose six coordinates have different periods."""
    amplitude = np.array([0.10, 0.12, 0.08, 0.35, 0.4, 0.45])
    rate = np.array([1.1, 0.7, 1.3, 0.9, 1.2, 0.8])
    phase = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    return HOME @ SE3.exp(amplitude * np.sin(rate * times[:, None] + phase))


def streamed(
    offset_s: float = 0.03,
    clock: Clock | None = None,
    seconds: float = 8.0,
    seed: int = 0,
    still: bool = False,
    stated: bool = True,
) -> Streamed:
    """Simulate records of the arm, and views on lines of their own, whose stamps plus `offset_s` are the arm's time."""
    rng = np.random.default_rng(seed)
    record_s, view_s = np.arange(0, seconds, 1 / RATE_HZ), np.arange(0.5, seconds - 0.5, 1 / VIEW_RATE_HZ)
    if still:  # no view while the arm goes from place to place
        phase = 3 * view_s / seconds
        view_s = view_s[np.abs(phase - np.round(phase)) < 0.3]

    def at(times: Array) -> SE3:
        """Poses of the flange along the path, or at the nearest of three places if `still`."""
        return path_poses(np.round(times / (seconds / 3)) * 10.0 if still else times)

    poses, camera_from_tag = (
        at(record_s),
        (at(view_s) @ MOUNT).inverse() @ TAG @ SE3.exp(SIGMA * rng.standard_normal((len(view_s), 6))),
    )
    sigma = SIGMA if stated else None
    views = [
        Sample(k, float(t - offset_s), observations=(PoseObservation("wrist", "tag", camera_from_tag[k], sigma),))
        for k, t in enumerate(view_s)
    ]
    records = [Sample(1000 + k, float(t), {"arm": RobotState(poses[k])}) for k, t in enumerate(record_s)]
    cell = Cell(
        "arm",
        {"arm": Robot("arm", noise=np.zeros(6) if stated else None)},
        {},
        {"wrist": CellCamera("wrist", "arm", clock=clock)},
        {"tag": CellTarget("tag", "world")},
    )
    return Streamed(cell, Recording((*views, *records)), offset_s)


def imaged(
    line_s: float, shutter: RollingShutter | None, noise_px: float = 0.1, seconds: float = 8.0, seed: int = 0
) -> Streamed:
    """Simulate records of the arm, and pixels of a fixed board, each exposed when its image row is read."""
    rng = np.random.default_rng(seed)
    lens = Camera("pinhole", np.array([900.0, 905.0, 640.0, 360.0]), (1280, 720))
    board = grid_of_points()
    record_s, view_s = np.arange(0, seconds, 1 / RATE_HZ), np.arange(0.5, seconds - 0.5, 1 / VIEW_RATE_HZ)
    pixels = np.zeros((len(view_s), len(board.points), 2))
    for _ in range(4):
        times = view_s[:, None] + line_s * pixels[..., 1]
        flange = path_poses(times.ravel())
        points = np.tile(board.points, (len(view_s), 1))
        pixels = lens.project((flange @ MOUNT).inverse() @ (BOARD @ points)).reshape(pixels.shape)
    pixels += noise_px * rng.standard_normal(pixels.shape)
    sigma = np.full(len(board.points), max(noise_px, 1e-3))
    views = [
        Sample(k, float(t), observations=(PixelObservation("wrist", "board", board.ids, pixels[k], sigma),))
        for k, t in enumerate(view_s)
    ]
    poses = path_poses(record_s)
    records = [Sample(1000 + k, float(t), {"arm": RobotState(poses[k])}) for k, t in enumerate(record_s)]
    wrist = CellCamera(
        "wrist",
        "arm",
        size_px=(1280, 720),
        intrinsics=Intrinsics("fixed", lens),
        clock=Clock(),
        rolling_shutter=shutter,
    )
    arm = Robot("arm", noise=np.zeros(6))
    cell = Cell("arm", {"arm": arm}, {}, {"wrist": wrist}, {"board": CellTarget("board", "world", target=board)})
    return Streamed(cell, Recording((*views, *records)), 0.0)


def grid_of_points() -> Target:
    """A target of twenty points, 2 cm apart and not quite in a plane."""
    across, down = np.meshgrid(np.arange(5), np.arange(4))
    places = np.stack([across.ravel(), down.ravel(), 0.3 * (across * down % 3).ravel()], -1)
    return points_target(0.02 * (places - places.mean(0)))
