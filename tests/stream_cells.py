"""Streams of an arm with a wrist camera that moves smoothly before a tag, each by a clock of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.cell import Cell, CellCamera, CellTarget, Clock, PoseObservation, Recording, Robot, RobotState, Sample
from basecal.geometry import SE3, Array

HOME = SE3.exp(np.array([0.4, 0.1, 0.6, 0.2, 2.9, 0.1]))
MOUNT = SE3.exp(np.array([0.03, -0.02, 0.08, 0.1, -0.1, 0.4]))  # flange from camera
TAG = SE3.exp(np.array([0.5, 0.0, 0.02, 0.0, 0.0, 0.3]))  # base from tag
SIGMA = np.repeat([5e-4, 1e-3], 3)  # of a measured pose [m, rad]
RATE, VIEW_RATE = 50.0, 10.0  # records and views a second


@dataclass(frozen=True, eq=False)
class Streamed:
    """A cell, its recording, and the true offset of the camera's clock [s]."""

    cell: Cell
    recording: Recording
    offset_s: float


def along(times: Array) -> SE3:
    """Where the flange is, `base_from_flange`, at instants [s]: no two of its six motions go together."""
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
    """Records of the arm in lines of their own, and views whose stamps plus `offset_s` are the arm's time."""
    rng = np.random.default_rng(seed)
    told_s, seen_s = np.arange(0, seconds, 1 / RATE), np.arange(0.5, seconds - 0.5, 1 / VIEW_RATE)
    if still:  # no view while the arm goes from place to place
        part = 3 * seen_s / seconds
        seen_s = seen_s[np.abs(part - np.round(part)) < 0.3]

    def at(times: Array) -> SE3:
        """The flange: all along its way, or always at the nearest of three places."""
        return along(np.round(times / (seconds / 3)) * 10.0 if still else times)

    poses, seen = (
        at(told_s),
        (at(seen_s) @ MOUNT).inverse() @ TAG @ SE3.exp(SIGMA * rng.standard_normal((len(seen_s), 6))),
    )
    sigma = SIGMA if stated else None
    views = [
        Sample(k, float(t - offset_s), observations=(PoseObservation("wrist", "tag", seen[k], sigma),))
        for k, t in enumerate(seen_s)
    ]
    records = [Sample(1000 + k, float(t), {"arm": RobotState(poses[k])}) for k, t in enumerate(told_s)]
    cell = Cell(
        "arm",
        {"arm": Robot("arm", noise=np.zeros(6) if stated else None)},
        {},
        {"wrist": CellCamera("wrist", "arm", clock=clock)},
        {"tag": CellTarget("tag", "world")},
    )
    return Streamed(cell, Recording((*views, *records)), offset_s)
