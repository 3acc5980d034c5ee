"""Groups of views made from their two ends, or with one end changed."""

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
    """An end of as many views as there are poses, stops or joints; poses are the identity if not given."""
    given = [rows for rows in (stop, stop_number, joints) if rows is not None]
    count = len(base_from_flange) if base_from_flange is not None else len(np.asarray(given[0])) if given else 0
    poses = SE3.identity((count,)) if base_from_flange is None else base_from_flange
    indices = (np.full(count, -1) if rows is None else np.array(rows, dtype=np.int64) for rows in (stop, stop_number))
    return End(robot, mount, base, poses, *indices, joints)


def views(
    eye: End, hand: End, seen: Measurement | None = None, *, camera: str = "camera", target: str = "target"
) -> ViewGroup:
    """Views between two ends, of samples from 0 on; measured poses are the identity if `seen` is not given."""
    count = max(len(each.base_from_flange) for each in (eye, hand))
    weight = np.ones((count, 6))
    seen = PoseMeasurement(SE3.identity((count,)), weight, weight) if seen is None else seen
    return ViewGroup(camera, target, (eye, hand), np.arange(count), seen)


def with_eye(group: ViewGroup, **changes: Any) -> ViewGroup:
    """The group with changes to the camera's end."""
    return replace(group, ends=(replace(group.eye, **changes), group.hand))


def with_hand(group: ViewGroup, **changes: Any) -> ViewGroup:
    """The group with changes to the target's end."""
    return replace(group, ends=(group.eye, replace(group.hand, **changes)))


def problem_of(*groups: ViewGroup, **others: Any) -> Problem:
    """A problem of these groups without unknowns or stops, except for `others`."""
    empty = Problem("", groups, {}, frozenset(), {}, Stops(np.zeros((0, 6))), {})
    return replace(empty, **others)
