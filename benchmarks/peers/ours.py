"""Ours, from the pixels and from the same poses as the others; with the sigmas stated, and with none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from basecal.cell import Cell, Recording
from basecal.cell.recording import PoseObservation
from basecal.estimation.settings import STATED, Settings
from basecal.estimation.solve import solve
from basecal.geometry import PoseEstimate
from benchmarks.peers.task import Task

PIXELS, POSES = "basecal, pixels", "basecal, poses"
UNSTATED = ", no sigma stated"
ESTIMATED = ", robots' noise estimated"
ESTIMATED_SAMPLES = 30


def works(task: Task) -> dict[str, Callable[[], PoseEstimate]]:
    """By name."""
    cell, bare = task.made.cell, _unstated(task.made.cell)
    found = {
        PIXELS: partial(_asked, task, cell, task.made.recording),
        POSES: partial(_asked, task, cell, _of_poses(task, stated=True)),
        PIXELS + UNSTATED: partial(_asked, task, bare, task.made.recording),
        POSES + UNSTATED: partial(_asked, task, bare, _of_poses(task, stated=False)),
    }
    if len(task.made.recording.samples) == ESTIMATED_SAMPLES:
        found[PIXELS + ESTIMATED] = partial(_asked, task, bare, task.made.recording, Settings(robot_noise="estimated"))
    return found


def _asked(task: Task, cell: Cell, recording: Recording, settings: Settings = STATED) -> PoseEstimate:
    return solve(cell, recording, settings).transforms[task.asked]


def _unstated(cell: Cell) -> Cell:
    """The cell without the sigmas of pixels and robots."""
    robots = {name: replace(robot, noise=None) for name, robot in cell.robots.items()}
    return replace(cell, pixel_px=None, robots=robots)


def _of_poses(task: Task, stated: bool) -> Recording:
    """The recording with the poses of `solvePnP` for pixels, and their sigmas where `stated`."""
    samples = []
    for k, sample in enumerate(task.made.recording.samples):
        sigma = task.sigma[k] if stated else None
        seen = PoseObservation("wrist", "board", task.camera_from_target[k], sigma)
        samples.append(replace(sample, observations=(seen,)))
    return replace(task.made.recording, samples=tuple(samples))
