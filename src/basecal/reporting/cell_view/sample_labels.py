"""Labels of samples for the slider, and the sample with the largest residual."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.accuracy.sample_use import outlier_views
from basecal.cell import Calibration, SampleResidual
from basecal.fields.digits import two_digits
from basecal.reporting.statement.verdict import error_text


def sample_labels(samples: Sequence[int], calibration: Calibration) -> list[str]:
    """Text with the residuals of each sample's views; empty for a sample without views."""
    texts: dict[int, list[str]] = {sample: [] for sample in samples}
    left_out = outlier_views(calibration)
    for view in calibration.residuals.per_sample:
        if view.sample not in texts:
            continue
        texts[view.sample].append(view_words(view, " (left out)" if view in left_out else ""))
    return ["; ".join(views) for views in texts.values()]


def view_words(view: SampleResidual, state: str = "") -> str:
    """Text with camera, target and known residuals of a view."""
    errors = [] if view.rms_px is None else [f"reprojection error {two_digits(view.rms_px)} px"]
    if view.loop_m is not None:
        errors.append(f"pose consistency error {error_text(view.loop_m, view.loop_rad)}")
    return f"{view.target} seen by {view.camera}{state}: {', '.join(errors) or 'no residual'}"


def is_measured(view: SampleResidual) -> bool:
    """Whether a view has any residual."""
    return view.rms_px is not None or view.loop_m is not None


def misfit(view: SampleResidual) -> tuple[float, float]:
    """Residuals of a view as a sort key [px, m]."""
    return view.rms_px or 0.0, view.loop_m or 0.0


def worst_sample(calibration: Calibration) -> int | None:
    """The sample of the used view with the largest residual; None if no view has a residual."""
    left_out = outlier_views(calibration)
    used = [view for view in calibration.residuals.per_sample if view not in left_out and is_measured(view)]
    return max(used, key=misfit).sample if used else None
