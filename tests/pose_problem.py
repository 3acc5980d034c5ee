"""The smallest problem: an arm with a camera in front of a fixed target, measured as poses near the identity.

With every pose near the identity, translations and rotations hardly mix. Least squares are then means, and their
covariances are known in closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, IntArray
from tests.ends import with_eye, with_hand

MOUNT, TARGET = "eye_flange_from_camera", "eye_base_from_target"

OWN = ([0, 1, 2, 3], [-1] * 4)
CHAINED = ([0, 0, 1, 2], [3, 4, 4, 5])  # 0, 1, 3 and 4 are tied, and 2 and 5
STAR = ([0, 1, 2, 3, 4, 5], [6, 6, 6, 6, 6, 7])  # 6 is tied to five
EXACT = ([-1] * 3, [-1] * 3)
SINGLE = ([0], [1])


def pose_problem(
    errors: Array, sigma: Array | None, prior: Unknown | None = None, stop_sigma: Array | None = None
) -> tuple[Problem, State]:
    """Return a problem whose measured poses have these errors, (n, 6), and the state without errors.

    Args:
        errors: Right tangents of the measured poses.
        sigma: (6,) stated sigmas of the poses; None where they are not stated.
        prior: What is known of the camera's mount, the only unknown.
        stop_sigma: (6,) sigmas of the arm's poses, each sample at a stop of its own.
    """
    n = len(errors)
    poses, fixed = SE3.identity((n,)), SE3.identity()
    stated = np.zeros((n, 6)) if sigma is None else np.tile(1 / sigma, (n, 1))
    measured = PoseMeasurement(poses @ SE3.exp(errors), stated, np.where(stated > 0, stated, 1.0))
    rows, none = np.arange(n), np.full(n, -1)
    stop = none if stop_sigma is None else rows
    ends = End("eye", MOUNT, None, poses, stop, rows), End(None, TARGET, None, poses, none, none)
    group = ViewGroup("camera", "target", ends, rows, measured)
    stops = Stops(np.zeros((0, 6))) if stop_sigma is None else Stops(np.tile(stop_sigma, (n, 1)), ("eye",) * n)
    unknowns = {MOUNT: prior or Unknown(), TARGET: Unknown("fixed", fixed)}
    problem = Problem("eye", (group,), unknowns, frozenset(), {}, stops, {MOUNT: slice(0, 6)})
    return problem, State({MOUNT: fixed, TARGET: fixed}, {}, np.zeros((len(stops), 6)))


def two_arm_problem(errors: Array, eye_stop: Sequence[int], hand_stop: Sequence[int]) -> tuple[Problem, State]:
    """Return a problem as `pose_problem`, with the target on a second arm `hand` whose base is the world.

    Both arms have unit sigmas.

    Args:
        errors: (n, 6) right tangents of the measured poses.
        eye_stop: (n,) the stop of each view, from 0 on; all -1 if the arm is exact.
        hand_stop: (n,) the same for the hand; its numbers go on after those of `eye_stop`.
    """
    problem, state = pose_problem(errors, None)
    (group,) = problem.groups
    eye, hand = np.array(eye_stop), np.array(hand_stop)
    count = eye.max() + 1
    robots = ("eye",) * count + ("hand",) * max(hand.max() + 1 - count, 0)
    group = with_hand(
        with_eye(group, stop=eye, stop_number=_stands(eye)), robot="hand", stop=hand, stop_number=_stands(hand)
    )
    stops = Stops(np.ones((len(robots), 6)), robots)
    return replace(problem, groups=(group,), stops=stops), replace(state, stop_errors=np.zeros((len(stops), 6)))


def _stands(stop: IntArray) -> IntArray:
    return np.arange(len(stop)) if stop.max() < 0 else stop - stop.min()


def shaken(problem, views, known_s=0.0):
    """Return the problem with the camera in motion at all views, and the motion; jitter is open if not known."""
    (group,) = problem.groups
    motion = np.random.default_rng(9).standard_normal((views, 6))
    jitter = {"jitter_s": {"camera": known_s}} if known_s else {"open_jitter": frozenset({"camera"})}
    return replace(problem.with_groups([replace(group, motion=motion)]), **jitter), motion
