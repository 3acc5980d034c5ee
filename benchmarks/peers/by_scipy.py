"""SciPy's `least_squares` on poses: how well the loop closes, weighted by its errors after a first round.

The residual of a sample is the tangent of `(A X B).inverse() @ Y C Z`, and with one arm of `(A X B).inverse() @ W`.
Translations and rotations are divided by their rms after the first round. It starts from the result of OpenCV that
closes the loop best. If both arms move, OpenCV has no result, and it starts from the truth.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from basecal.geometry import SE3, Array
from benchmarks.peers.task import Task

_FIRST = (1e-3, 1e-3)
Start = tuple[SE3, ...]
Loop = Callable[[Start], SE3]


def close_loop(task: Task, starts: list[Start]) -> SE3:
    """The requested transform, from the one of `starts` that closes the loop best; it comes first in each start."""
    one_arm = task.hand_base_from_hand_flange is None
    loop = _one_arm_loop(task) if one_arm else _two_arm_loop(task)
    first = np.repeat(_FIRST, 3)
    start = min(starts, key=lambda each: float(np.sum((loop(each).log() / first) ** 2)))
    first_end = _minimize(loop, start, first)
    errors = loop(first_end).log()
    rms = [float(np.sqrt(np.mean(part**2))) for part in (errors[:, :3], errors[:, 3:])]
    return _minimize(loop, first_end, np.repeat(rms, 3))[0]


def _one_arm_loop(task: Task) -> Loop:
    a, b = task.eye_base_from_eye_flange, task.camera_from_target
    return lambda x: (a @ x[0] @ b).inverse() @ x[1]


def _two_arm_loop(task: Task) -> Loop:
    a, b, c = task.eye_base_from_eye_flange, task.camera_from_target, task.hand_base_from_hand_flange
    assert c is not None
    return lambda x: (a @ x[1] @ b).inverse() @ x[0] @ c @ x[2]


def _minimize(loop: Loop, start: Start, sigma: Array) -> Start:
    def retract(step: Array) -> Start:
        return tuple(each @ SE3.exp(xi) for each, xi in zip(start, step.reshape(-1, 6), strict=True))

    def residuals(step: Array) -> Array:
        weighed: Array = (loop(retract(step)).log() / sigma).ravel()
        return weighed

    return retract(least_squares(residuals, np.zeros(6 * len(start)), method="lm").x)
