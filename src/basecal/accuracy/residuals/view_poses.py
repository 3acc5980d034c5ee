"""Where each camera stood to the target in each view, as a calibration has it."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.accuracy.residuals.evaluation import Evaluation
from basecal.geometry import SE3, IntArray


@dataclass(frozen=True, eq=False)
class ViewPoses:
    """The views of one target by one camera: `sample` (n,) and `camera_from_target` (n,)."""

    camera: str
    target: str
    sample: IntArray
    camera_from_target: SE3


def view_poses(evaluation: Evaluation) -> tuple[ViewPoses, ...]:
    """The poses of all views whose transforms are known, those left out as outliers among them."""
    return tuple(
        ViewPoses(g.camera, g.target, g.sample, evaluation.state.camera_from_target(g, evaluation.problem.stops))
        for g in evaluation.problem.groups
    )
