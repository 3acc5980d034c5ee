"""Labels of the slider for each sample, and the sample that fits worst."""

from __future__ import annotations

import math
from collections.abc import Sequence

from basecal.accuracy.sample_use import outlier_views
from basecal.cell import Calibration


def sample_labels(samples: Sequence[int], calibration: Calibration) -> list[str]:
    """How each sample fits in words, views one after another; a sample without any view has none."""
    said: dict[int, list[str]] = {sample: [] for sample in samples}
    left_out = outlier_views(calibration)
    for view in calibration.residuals.per_sample:
        if view.sample not in said:
            continue
        errors = []
        if view.rms_px is not None:
            errors.append(f"reprojection error {view.rms_px:.3g} px")
        if view.loop_m is not None:
            angle = "" if view.loop_rad is None else f" and {math.degrees(view.loop_rad):.3g} deg"
            errors.append(f"pose consistency error {1e3 * view.loop_m:.3g} mm{angle}")
        unused = " (left out)" if view in left_out else ""
        fit = f": {', '.join(errors)}" if errors else ""
        said[view.sample].append(f"{view.target} seen by {view.camera}{unused}{fit}")
    return ["; ".join(views) for views in said.values()]


def worst_sample(calibration: Calibration) -> int | None:
    """The sample with the view that fits worst, of those that were used; None if no view has a residual."""
    left_out = outlier_views(calibration)
    used = [view for view in calibration.residuals.per_sample if view not in left_out]
    measured = [view for view in used if view.rms_px is not None or view.loop_m is not None]
    if not measured:
        return None
    return max(measured, key=lambda view: (view.rms_px or 0.0, view.loop_m or 0.0)).sample
