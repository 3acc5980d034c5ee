"""How far each point is from where a calibration predicts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.residuals.evaluation import Evaluation, evaluate_recording
from basecal.cell import Calibration, Cell, Outlier, Recording
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class PointResiduals:
    """The points of one target that one camera saw, over all samples.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        sample: (n,) sample numbers.
        ids: (n,) which points.
        pixels: (n, 2) as seen [px].
        off_px: (n, 2) predicted minus seen [px].
        used: (n,) whether the answer rests on them; the others were left out as outliers.
    """

    camera: str
    target: str
    sample: IntArray
    ids: IntArray
    pixels: Array
    off_px: Array
    used: BoolArray


def point_residuals(cell: Cell, recording: Recording, calibration: Calibration) -> tuple[PointResiduals, ...]:
    """Predicted minus seen pixels at the transforms of a calibration, fresh or read from its file.

    Args:
        cell: What was calibrated.
        recording: What was seen.
        calibration: What came out.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    return residuals_of_points(cell, calibration, evaluate_recording(cell, recording, calibration))


def residuals_of_points(cell: Cell, calibration: Calibration, evaluation: Evaluation) -> tuple[PointResiduals, ...]:
    """Residuals of points that were fitted again already."""
    return tuple(
        _group_residuals(target.ids, group, group.measurement, evaluation, calibration.outliers or ())
        for group in evaluation.problem.groups
        if isinstance(group.measurement, PixelMeasurement) and (target := cell.targets[group.target].target)
    )


def _group_residuals(
    ids: IntArray,
    group: ViewGroup,
    measurement: PixelMeasurement,
    evaluation: Evaluation,
    outliers: Sequence[Outlier],
) -> PointResiduals:
    predicted = evaluation.state.camera_from_target(group, evaluation.problem.stops)
    off = measurement.residual_px(predicted, evaluation.state.cameras[group.camera])
    view, point = np.nonzero(np.isfinite(off).all(-1))
    pixels = measurement.pixels[view, point]
    samples, named = group.sample[view], ids[point]
    used = np.ones(len(samples), dtype=bool)
    for outlier in outliers:
        if (outlier.camera, outlier.target) == (group.camera, group.target):
            of_view = samples == outlier.sample
            used[of_view & np.isin(named, outlier.ids) if outlier.ids else of_view] = False
    return PointResiduals(group.camera, group.target, samples, named, pixels, off[view, point], used)
