"""Frames of tf: which hangs on which, what moves, and the way from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.errors import FrameNotFound, InputError, list_names
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array


class Hang(NamedTuple):
    """How a frame hangs on another, as it was first seen.

    Attributes:
        parent: The other frame.
        values: (7,) x, y, z [m], quaternion x, y, z, w.
        is_fixed: Whether only /tf_static has it, or it never changes.
        is_timed: Whether /tf has it.
    """

    parent: str
    values: Array
    is_fixed: bool
    is_timed: bool


class Step(NamedTuple):
    """One frame of a way: `child` hangs on the frame before it, or the frame before it on what comes, turned back."""

    child: str
    is_back: bool


@dataclass(frozen=True, eq=False)
class Tree:
    """The frames of a bag, by the name of the child."""

    hangs: Mapping[str, Hang]

    @property
    def names(self) -> tuple[str, ...]:
        """All frames."""
        return tuple(sorted({*self.hangs, *(hang.parent for hang in self.hangs.values())}))

    def ancestors(self, frame: str) -> list[str]:
        """The frame, what it hangs on, and so on to the root; a circle ends it."""
        found = [frame]
        while found[-1] in self.hangs and self.hangs[found[-1]].parent not in found:
            found.append(self.hangs[found[-1]].parent)
        return found

    def rigid_ancestors(self, frame: str) -> list[str]:
        """Ancestors of a frame, as far as nothing moves."""
        found = [frame]
        for each in self.ancestors(frame)[1:]:
            if not self.hangs[found[-1]].is_fixed:
                break
            found.append(each)
        return found

    def way(self, base: str, tip: str) -> tuple[Step, ...]:
        """The way from one frame to another.

        Raises:
            FrameNotFound: if one is not there.
            InputError: if nothing joins them.
        """
        for frame in (base, tip):
            if frame not in self.names:
                raise FrameNotFound(frame, self.names)
        up, down = self.ancestors(base), self.ancestors(tip)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise InputError(f"no transform of tf joins {base!r} and {tip!r}; they hang on {up[-1]!r} and {down[-1]!r}")
        back = tuple(Step(frame, True) for frame in up[: up.index(common)])
        return (*back, *(Step(frame, False) for frame in reversed(down[: down.index(common)])))


def transform_values(transform: Any) -> Array:
    """(7,) numbers of a `geometry_msgs/Transform`."""
    return _numbers(transform.translation, transform.rotation)


def pose_values(pose: Any) -> Array:
    """(7,) numbers of a `geometry_msgs/Pose`."""
    return _numbers(pose.position, pose.orientation)


def _numbers(t: Any, q: Any) -> Array:
    return np.array([t.x, t.y, t.z, q.x, q.y, q.z, q.w], dtype=np.float64)


def pose_from_values(values: Array, subject: str) -> SE3:
    """Poses of (..., 7) numbers.

    Raises:
        InputError: if one is none.
    """
    if not np.all(np.abs(values) <= LARGEST_VALUE):
        raise InputError(f"{subject}: not all numbers are finite, and within {LARGEST_VALUE:g}")
    return SE3.from_quaternion(values[..., 3:], values[..., :3], subject)


def compose_path(tree: Tree, way: tuple[Step, ...], motions: Mapping[str, Array], subject: str) -> SE3:
    """The last frame of a way in its first, at each of some instants.

    Args:
        tree: The frames.
        way: From one frame to another.
        motions: (n, 7) by frame that moves.
        subject: What to call it in an error.
    """
    total = SE3.identity()
    for step in way:
        values = motions.get(step.child, tree.hangs[step.child].values)
        pose = pose_from_values(values, f"{subject}, {step.child}")
        total = total @ (pose.inverse() if step.is_back else pose)
    return total


def hint(tree: Tree) -> str:
    """The frames there are, for an error."""
    return f"frames of tf are: {list_names(list(tree.names))}"
