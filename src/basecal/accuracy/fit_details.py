"""Details of a fit for its report, computed from a calibration and its recording."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.accuracy.axis_shift import ClosedFormComparison, compare_closed_form
from basecal.accuracy.residuals.evaluation import Evaluation, evaluate_recording
from basecal.accuracy.residuals.point_residuals import PointResiduals, residuals_of_points
from basecal.accuracy.task.expected_error import ExpectedError, expected_errors
from basecal.cell import Calibration, Cell, Recording
from basecal.geometry import SE3, IntArray


@dataclass(frozen=True, eq=False)
class FitDetails:
    """Details of how a recording fits a calibration.

    Attributes:
        points: Residuals of the points, by camera and target.
        views: Poses of the views, by camera and target.
        errors: Expected errors of the requested transforms.
        closed_form: The paper's closed form compared with the answer; None if the recording has no programmed shifts.
    """

    points: tuple[PointResiduals, ...] = ()
    views: tuple[ViewPoses, ...] = ()
    errors: tuple[ExpectedError, ...] = ()
    closed_form: ClosedFormComparison | None = None


def fit_details(cell: Cell, recording: Recording, calibration: Calibration) -> FitDetails:
    """Details of a calibration, new or read from its file, for the recording that it was computed from.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    fitted = evaluate_recording(cell, recording, calibration)
    return FitDetails(
        residuals_of_points(cell, calibration, fitted),
        view_poses(fitted),
        expected_errors(cell, calibration, fitted),
        compare_closed_form(cell, recording, calibration),
    )


@dataclass(frozen=True, eq=False)
class ViewPoses:
    """Views of one target by one camera: their `sample` numbers, (n,), and `camera_from_target` poses, (n,)."""

    camera: str
    target: str
    sample: IntArray
    camera_from_target: SE3


def view_poses(evaluation: Evaluation) -> tuple[ViewPoses, ...]:
    """Poses of all views whose transforms are known, including outliers."""
    return tuple(
        ViewPoses(g.camera, g.target, g.sample, evaluation.state.camera_from_target(g, evaluation.problem.stops))
        for g in evaluation.problem.groups
    )
