"""Where each camera stood to the target in each view, as a calibration has it."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.accuracy.residuals.fitted_again import FittedAgain
from basecal.geometry import SE3, IntArray


@dataclass(frozen=True, eq=False)
class ViewPoses:
    """The views of one target by one camera: `sample` (n,) and `camera_from_target` (n,)."""

    camera: str
    target: str
    sample: IntArray
    camera_from_target: SE3


def view_poses(fitted: FittedAgain) -> tuple[ViewPoses, ...]:
    """The poses of all views whose transforms are known, those left out as outliers among them."""
    return tuple(
        ViewPoses(g.camera, g.target, g.sample, fitted.state.camera_from_target(g, fitted.problem.stops))
        for g in fitted.problem.groups
    )
