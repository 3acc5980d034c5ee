"""Transforms between rigidly connected frames from correlated estimates.

Along a chain T = T_1 ... T_n the tangent of T is the sum of Ad((T_k+1 ... T_n)^-1) x_k to first order; for a transform
that is inverted in the chain, -Ad(T) x replaces x.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.errors import FrameNotFound, InputError
from basecal.geometry import SE3, Array, PoseEstimate

_FROM, _BASE = "_from_", "_base"


def base_between(
    transforms: Mapping[str, PoseEstimate],
    order: Sequence[str],
    joint_covariance: Array | None,
    robot: str,
    other_robot: str,
) -> PoseEstimate:
    """Estimate of `<robot>_base_from_<other>_base` with its covariance; see `frame_between`.

    Raises:
        FrameNotFound: if a robot does not exist, or its base was not estimated.
    """
    bases = {frame for name in transforms for frame in name.split(_FROM) if frame.endswith(_BASE)}
    for name in (robot, other_robot):
        if name + _BASE not in bases:
            raise FrameNotFound(name, sorted(base.removesuffix(_BASE) for base in bases))
    return frame_between(transforms, order, joint_covariance, robot + _BASE, other_robot + _BASE)


def frame_between(
    transforms: Mapping[str, PoseEstimate],
    order: Sequence[str],
    joint_covariance: Array | None,
    parent: str,
    child: str,
) -> PoseEstimate:
    """Estimate of `<parent>_from_<child>` with its covariance (6, 6) [m, rad], in the axes of the child.

    Args:
        transforms: Estimates by name; each has a rotation.
        order: Names of the transforms of `joint_covariance`; the others are exact.
        joint_covariance: (6 n, 6 n) covariance of the right tangents of `order` [m, rad]; None if all are exact.
        parent: A frame in a transform's name, such as `hand_base`.
        child: Another frame.

    Raises:
        FrameNotFound: if no transform names one of the frames.
        InputError: if no chain of transforms connects the two frames.
    """
    frames = list(dict.fromkeys(frame for name in transforms for frame in name.split(_FROM)))
    for frame in (parent, child):
        if frame not in frames:
            raise FrameNotFound(frame, frames)
    rows = {name: 6 * k + np.arange(6) for k, name in enumerate(order)}
    mean, index_blocks, jacobians = SE3.identity(), [np.zeros(0, dtype=np.int64)], [np.zeros((6, 0))]
    for name, backwards in reversed(_chain(transforms, parent, child)):
        step = transforms[name].mean
        if joint_covariance is not None and name in rows:
            index_blocks.append(rows[name])
            adjoint = mean.inverse().adjoint()
            jacobians.append(-adjoint @ step.adjoint() if backwards else adjoint)
        mean = (step.inverse() if backwards else step) @ mean
    jacobian, indices = np.concatenate(jacobians, 1), np.concatenate(index_blocks)
    if joint_covariance is None:
        return PoseEstimate(mean, np.zeros((6, 6)))
    covariance = jacobian @ joint_covariance[np.ix_(indices, indices)] @ jacobian.T
    return PoseEstimate(mean, 0.5 * (covariance + covariance.T))


def _chain(transforms: Mapping[str, PoseEstimate], parent: str, child: str) -> list[tuple[str, bool]]:
    """Shortest chain of transforms from parent to child, each with whether it is inverted."""
    chains: dict[str, list[tuple[str, bool]]] = {parent: []}
    reached = [parent]
    for frame in reached:  # grows
        for name in transforms:
            first, second = name.split(_FROM)
            if frame in (first, second):
                other = second if frame == first else first
                if other not in chains:
                    chains[other] = [*chains[frame], (name, frame == second)]
                    reached.append(other)
    if child not in chains:
        raise InputError(
            f"{parent!r} and {child!r} are not rigidly connected by known transforms. "
            f"Frames rigidly connected to {parent!r}: {', '.join(reached[1:])}"
        )
    return chains[child]
