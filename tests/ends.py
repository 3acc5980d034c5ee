"""Groups of views by their ends, made up or changed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from basecal.estimation.problem.problem import Problem, Stops
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array


def end(
    robot: str | None = None,
    base_from_flange: SE3 | None = None,
    *,
    mount: str = "mount",
    base: str | None = None,
    stop: ArrayLike | None = None,
    stop_number: ArrayLike | None = None,
    joints: Array | None = None,
) -> End:
    """An end of as many views as it has poses, stops or joints; what is not given is none, or the identity."""
    given = [of for of in (stop, stop_number, joints) if of is not None]
    count = len(base_from_flange) if base_from_flange is not None else len(np.asarray(given[0])) if given else 0
    poses = SE3.identity((count,)) if base_from_flange is None else base_from_flange
    rows = (np.full(count, -1) if of is None else np.array(of, dtype=np.int64) for of in (stop, stop_number))
    return End(robot, mount, base, poses, *rows, joints)


def views(
    eye: End, hand: End, seen: Measurement | None = None, *, camera: str = "camera", target: str = "target"
) -> ViewGroup:
    """Views of these ends, of samples from 0 on; of poses at the identity if nothing is said of what was seen."""
    count = max(len(of.base_from_flange) for of in (eye, hand))
    weight = np.ones((count, 6))
    seen = PoseMeasurement(SE3.identity((count,)), weight, weight) if seen is None else seen
    return ViewGroup(camera, target, (eye, hand), np.arange(count), seen)


def with_eye(group: ViewGroup, **changes: Any) -> ViewGroup:
    """The same with another end of the camera."""
    return replace(group, ends=(replace(group.eye, **changes), group.hand))


def with_hand(group: ViewGroup, **changes: Any) -> ViewGroup:
    """The same with another end of the target."""
    return replace(group, ends=(group.eye, replace(group.hand, **changes)))


def problem_of(*groups: ViewGroup, **others: Any) -> Problem:
    """A problem of these views, of which nothing else is known."""
    nothing = Problem("", groups, {}, frozenset(), {}, Stops(np.zeros((0, 6))), {})
    return replace(nothing, **others)
