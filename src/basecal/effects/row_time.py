"""Row time: the delay between the exposures of consecutive image rows differs from the stated one."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import Effect
from basecal.geometry import SE3, Array, Camera


def row_shift(camera: Camera, pose: SE3, velocity: Array, points_in_target: Array, after_s: Array) -> Array:
    """Shifts of pixels from their positions at the instant of the mean row, (p, 2) [px]; 0 for points not visible.

    Args:
        camera: The lens.
        pose: `camera_from_target` at the instant of the mean row.
        velocity: (6,) of the target in the camera, in the target's axes [m/s, rad/s].
        points_in_target: (p, 3) [m].
        after_s: (p,) time from the instant of the mean row to the exposure of each pixel's row [s].
    """
    moved = SE3.exp(after_s[:, None] * velocity) @ points_in_target
    return np.nan_to_num(camera.project(pose @ moved) - camera.project(pose @ points_in_target))


EFFECT = Effect(
    "row_time",
    elsewhere={
        "statement": "basecal.cell.cell",
        "size": "basecal.cell.cell: stated with its sigma",
        "unknown": "basecal.accuracy.clocks",
        "words": "basecal.accuracy.clocks.correction",
    },
    absent={
        "random": "a camera has one row time for all images",
        "candidate": "arms at rest do not show it; in streams it is estimated if it is not stated",
        "map": "the answer's covariance contains it",
        "fault": "arms of the simulator are at rest when an image is taken",
    },
)
