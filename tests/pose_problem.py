"""The smallest problem there is: an arm with a camera before a target on the world, seen as poses near the identity.

With every pose near the identity translations and rotations hardly mix, so that least squares are means and their
covariances are known in closed form.
"""

from __future__ import annotations

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.problem.problem import Problem, State, Stops, ViewGroup
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array

MOUNT, TARGET = "eye_flange_from_camera", "eye_base_from_target"


def pose_problem(
    errors: Array, sigma: Array | None, prior: Unknown | None = None, stop_sigma: Array | None = None
) -> tuple[Problem, State]:
    """Poses off by `errors`, (n, 6), of a target that is fixed, and the state without errors.

    Args:
        errors: Right tangents of the measured poses.
        sigma: (6,) stated sigmas of the poses; None where they are not stated.
        prior: What is known of the camera's mount, the only unknown.
        stop_sigma: (6,) sigmas of the arm's poses, each sample at a stop of its own.
    """
    n = len(errors)
    at, fixed = SE3.identity((n,)), SE3.identity()
    stated = np.zeros((n, 6)) if sigma is None else np.tile(1 / sigma, (n, 1))
    views = PoseMeasurement(at @ SE3.exp(errors), stated, np.where(stated > 0, stated, 1.0))
    rows, none = np.arange(n), np.full(n, -1)
    stop = none if stop_sigma is None else rows
    group = ViewGroup(
        "camera", "target", "eye", None, MOUNT, TARGET, None, None, rows, at, at, stop, none, rows, none, views
    )
    stops = Stops(np.zeros((0, 6))) if stop_sigma is None else Stops(np.tile(stop_sigma, (n, 1)), ("eye",) * n)
    unknowns = {MOUNT: prior or Unknown(), TARGET: Unknown("fixed", fixed)}
    problem = Problem("eye", (group,), unknowns, frozenset(), {}, stops, {MOUNT: slice(0, 6)})
    return problem, State({MOUNT: fixed, TARGET: fixed}, {}, np.zeros((len(stops), 6)))
