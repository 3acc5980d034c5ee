"""Tree of tf frames: parents, motion, and the path from one frame to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from basecal.errors import FrameNotFound, InputError, list_names
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array


class FrameTransform(NamedTuple):
    """First recorded transform `parent_from_frame` of a frame.

    Attributes:
        parent: Name of the parent frame.
        values: (7,) x, y, z [m], quaternion x, y, z, w.
        is_fixed: Whether the transform never changes, or is only in /tf_static.
        is_timed: Whether the transform is in /tf.
    """

    parent: str
    values: Array
    is_fixed: bool
    is_timed: bool


class Step(NamedTuple):
    """A step of a path by the transform of `child` in its parent, inverted if `is_back`."""

    child: str
    is_back: bool


@dataclass(frozen=True, eq=False)
class Tree:
    """Transforms of the frames of a bag, by the name of the child."""

    transforms: Mapping[str, FrameTransform]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self.transforms, *(hang.parent for hang in self.transforms.values())}))

    def ancestors(self, frame: str) -> list[str]:
        """Return the frame and its ancestors up to the root; a cycle ends the list."""
        found = [frame]
        while found[-1] in self.transforms and self.transforms[found[-1]].parent not in found:
            found.append(self.transforms[found[-1]].parent)
        return found

    def rigid_ancestors(self, frame: str) -> list[str]:
        """Return the frame and its ancestors up to the first moving transform."""
        found = [frame]
        for each in self.ancestors(frame)[1:]:
            if not self.transforms[found[-1]].is_fixed:
                break
            found.append(each)
        return found

    def path(self, base: str, tip: str) -> tuple[Step, ...]:
        """Return the path from one frame to another.

        Raises:
            FrameNotFound: if a frame does not exist.
            InputError: if no path connects the frames.
        """
        for frame in (base, tip):
            if frame not in self.names:
                raise FrameNotFound(frame, self.names)
        up, down = self.ancestors(base), self.ancestors(tip)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            roots = f"the roots of their trees are {up[-1]!r} and {down[-1]!r}"
            raise InputError(f"no transform of tf joins {base!r} and {tip!r}: {roots}")
        back = tuple(Step(frame, True) for frame in up[: up.index(common)])
        return (*back, *(Step(frame, False) for frame in reversed(down[: down.index(common)])))


def transform_values(transform: Any) -> Array:
    """Convert a `geometry_msgs/Transform` to (7,) x, y, z [m], quaternion x, y, z, w."""
    return _numbers(transform.translation, transform.rotation)


def pose_values(pose: Any) -> Array:
    """Convert a `geometry_msgs/Pose` to (7,) x, y, z [m], quaternion x, y, z, w."""
    return _numbers(pose.position, pose.orientation)


def _numbers(t: Any, q: Any) -> Array:
    return np.array([t.x, t.y, t.z, q.x, q.y, q.z, q.w], dtype=np.float64)


def pose_from_values(values: Array, subject: str) -> SE3:
    """Convert numbers, (..., 7), to poses, (...).

    Raises:
        InputError: if a number is not finite or too large, or a quaternion is not of norm 1.
    """
    if not np.all(np.abs(values) <= LARGEST_VALUE):
        raise InputError(f"{subject}: not all numbers are finite, and within {LARGEST_VALUE:g}")
    return SE3.from_quaternion(values[..., 3:], values[..., :3], subject)


def compose_path(tree: Tree, path: tuple[Step, ...], motions: Mapping[str, Array], subject: str) -> SE3:
    """Compose the transforms of a path: poses of its last frame in its first, (n,).

    Args:
        tree: The frames.
        path: The path from one frame to another.
        motions: (n, 7) numbers over time of each moving frame, by name.
        subject: Name of the poses in errors.
    """
    total = SE3.identity()
    for step in path:
        values = motions.get(step.child, tree.transforms[step.child].values)
        pose = pose_from_values(values, f"{subject}, {step.child}")
        total = total @ (pose.inverse() if step.is_back else pose)
    return total


def frame_hint(tree: Tree) -> str:
    """List of the frames for an error."""
    return f"frames of tf are: {list_names(list(tree.names))}"
