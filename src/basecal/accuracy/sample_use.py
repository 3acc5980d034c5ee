"""How many of the recorded samples an answer rests on."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.cell import Calibration, Recording, SampleResidual


@dataclass(frozen=True)
class SampleUse:
    """Samples of which at least one view was used, of those recorded; and how many views there were."""

    used: int
    recorded: int
    views: int


def sample_use(recording: Recording, calibration: Calibration) -> SampleUse:
    """The use of each sample of a recording: a view is excluded whole, or it counts."""
    views, left_out = calibration.residuals.per_sample, outlier_views(calibration)
    used = [view for view in views if view not in left_out]
    return SampleUse(len({view.sample for view in used}), len(recording.samples), len(views))


def outlier_views(calibration: Calibration) -> frozenset[SampleResidual]:
    """The views that are outliers as a whole."""
    whole = {
        (outlier.sample, outlier.camera, outlier.target) for outlier in calibration.outliers or () if not outlier.ids
    }
    views = calibration.residuals.per_sample
    return frozenset(view for view in views if (view.sample, view.camera, view.target) in whole)
