"""How many of the recorded samples an answer rests on."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.cell import Calibration, Recording


@dataclass(frozen=True)
class SampleUse:
    """Samples of which at least one view was used, of those recorded; and views likewise."""

    used: int
    recorded: int
    views_used: int
    views: int


def sample_use(recording: Recording, calibration: Calibration) -> SampleUse:
    """What a calibration used of a recording: a view is left out whole, or it counts."""
    views = [(view.sample, view.camera, view.target) for view in calibration.residuals.per_sample]
    left_out = {(o.sample, o.camera, o.target) for o in calibration.outliers or () if not o.ids}
    used = [view for view in views if view not in left_out]
    return SampleUse(len({sample for sample, *_ in used}), len(recording.samples), len(used), len(views))
