"""Number of recorded samples that a calibration uses."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.cell import Calibration, Recording, SampleResidual


@dataclass(frozen=True)
class SampleUse:
    """Number of samples with at least one used view, of recorded samples, and of views."""

    used: int
    recorded: int
    views: int


def sample_use(recording: Recording, calibration: Calibration) -> SampleUse:
    """Count the samples that a calibration uses; a view counts unless it is an outlier as a whole."""
    views, left_out = calibration.residuals.per_sample, outlier_views(calibration)
    used = [view for view in views if view not in left_out]
    return SampleUse(len({view.sample for view in used}), len(recording.samples), len(views))


def outlier_views(calibration: Calibration) -> frozenset[SampleResidual]:
    """Views that are outliers as a whole."""
    views, outliers = calibration.residuals.per_sample, calibration.outlier_views
    return frozenset(view for view in views if (view.sample, view.camera, view.target) in outliers)
