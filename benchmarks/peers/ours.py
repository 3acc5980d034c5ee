"""Our solver, from the pixels and from the same poses as the others, with the sigmas stated and with none."""

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
    """Our estimates as calls, by name."""
    cell, bare = task.made.cell, _unstated(task.made.cell)
    found = {
        PIXELS: partial(_solve, task, cell, task.made.recording),
        POSES: partial(_solve, task, cell, _pose_recording(task, stated=True)),
        PIXELS + UNSTATED: partial(_solve, task, bare, task.made.recording),
        POSES + UNSTATED: partial(_solve, task, bare, _pose_recording(task, stated=False)),
    }
    if len(task.made.recording.samples) == ESTIMATED_SAMPLES:
        found[PIXELS + ESTIMATED] = partial(_solve, task, bare, task.made.recording, Settings(robot_noise="estimated"))
    return found


def _solve(task: Task, cell: Cell, recording: Recording, settings: Settings = STATED) -> PoseEstimate:
    return solve(cell, recording, settings).transforms[task.asked]


def _unstated(cell: Cell) -> Cell:
    """The cell without the sigmas of pixels and robots."""
    robots = {name: replace(robot, noise=None) for name, robot in cell.robots.items()}
    return replace(cell, pixel_px=None, robots=robots)


def _pose_recording(task: Task, stated: bool) -> Recording:
    """The recording with the poses of `solvePnP` in place of pixels, with their sigmas if `stated`."""
    samples = []
    for k, sample in enumerate(task.made.recording.samples):
        sigma = task.sigma[k] if stated else None
        seen = PoseObservation("wrist", "board", task.camera_from_target[k], sigma)
        samples.append(replace(sample, observations=(seen,)))
    return replace(task.made.recording, samples=tuple(samples))
