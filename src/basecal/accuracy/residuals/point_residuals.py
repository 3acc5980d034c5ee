"""Residuals of single points at the transforms of a calibration."""

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
    """Residuals of the points of one target in the images of one camera, over all samples.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        sample: (n,) sample numbers.
        ids: (n,) identifiers of the points.
        pixels: (n, 2) observed pixels [px].
        off_px: (n, 2) predicted minus observed pixels [px].
        used: (n,) whether the calibration uses the point; the others are outliers.
    """

    camera: str
    target: str
    sample: IntArray
    ids: IntArray
    pixels: Array
    off_px: Array
    used: BoolArray


def point_residuals(cell: Cell, recording: Recording, calibration: Calibration) -> tuple[PointResiduals, ...]:
    """Compute predicted minus observed pixels at the transforms of a calibration, new or read from a file.

    Args:
        cell: The calibrated cell.
        recording: The recording.
        calibration: The calibration of the cell.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    return residuals_of_points(cell, calibration, evaluate_recording(cell, recording, calibration))


def residuals_of_points(cell: Cell, calibration: Calibration, evaluation: Evaluation) -> tuple[PointResiduals, ...]:
    """Compute the residuals of points from an evaluated recording."""
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
