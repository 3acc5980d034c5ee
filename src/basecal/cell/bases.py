"""How any base stands to any other, of estimates that all are relative to one of them.

With `a = r_from_a exp(x)`, `b = r_from_b exp(y)` and T the mean of `a_from_b`, its tangent is y - Ad(T^-1) x to first
order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.errors import FrameNotFound
from basecal.geometry import SE3, Array, PoseEstimate

_FROM, _BASE = "_base_from_", "_base"


def base_between(
    transforms: Mapping[str, PoseEstimate], order: Sequence[str], joint: Array | None, robot: str, other: str
) -> PoseEstimate:
    """`<robot>_base_from_<other>_base` with its covariance.

    Args:
        transforms: Estimates by name, bases among them.
        order: Names of those that `joint` is of.
        joint: (6 n, 6 n) covariance of their right tangents [m, rad]; None where none has any.
        robot: Name of a robot.
        other: Of another.

    Raises:
        FrameNotFound: if there is no such robot, or its base was not found.
    """
    bases = _bases(transforms)
    for name in (robot, other):
        if name not in bases:
            raise FrameNotFound(name, sorted(bases))
    of_robot, of_other = (bases[name] for name in (robot, other))
    means = [SE3.identity() if name is None else transforms[name].mean for name in (of_robot, of_other)]
    relative = means[0].inverse() @ means[1]
    rows = {name: 6 * k + np.arange(6) for k, name in enumerate(order)}
    covariance = np.zeros((6, 6))
    if robot == other or joint is None:
        return PoseEstimate(relative, covariance)
    by = {of_robot: -relative.inverse().adjoint(), of_other: np.eye(6)}
    estimated = [name for name in by if name in rows]
    for a in estimated:
        for b in estimated:
            covariance += by[a] @ joint[np.ix_(rows[str(a)], rows[str(b)])] @ by[b].T
    return PoseEstimate(relative, 0.5 * (covariance + covariance.T))


def _bases(transforms: Mapping[str, PoseEstimate]) -> dict[str, str | None]:
    """Names of the transforms of bases, by robot; None of the reference's, which the others are relative to."""
    found: dict[str, str | None] = {}
    for name in transforms:
        reference, is_one, robot = name.partition(_FROM)
        if is_one and robot.endswith(_BASE):
            found |= {reference: None, robot.removesuffix(_BASE): name}
    return found
