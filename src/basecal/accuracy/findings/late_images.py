"""`clock-offset`: outlier images of moving robots that fit if they were taken slightly later or earlier."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.outlier_samples import FEW_SHARE
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Finding
from basecal.fields.digits import two_digits
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

# Share of a view's squared residual that a time offset explains: with residuals in six random directions, 1 in 900
# views has it by chance, by Beta(1/2, 5/2).
_EXPLAINED_SHARE = 0.9
_LONGEST_S = 0.5  # [s] within which the velocity predicts the motion of a target; assumed
_SHOWN_IMAGES = 5  # images whose delay is listed; assumed


class _Late(NamedTuple):
    """An image with the delay of its exposure after its time stamp [s]; negative if it was taken earlier."""

    sample: int
    delay_s: float


def late_images(evidence: Evidence) -> list[Finding]:
    """Findings about the outlier images of each camera that a time offset explains; a warning above 3 % of samples."""
    outliers = {(o.sample, o.camera) for o in evidence.robust.outliers if not o.ids}
    found = []
    for camera in sorted({camera for _, camera in outliers}):
        late = _late_samples(evidence, camera, {sample for sample, name in outliers if name == camera})
        if late:
            numbers = tuple(str(each.sample) for each in late)
            do = ("Look for a trigger that was missed, or a driver that stamps on arrival.",)
            found.append(
                Finding(
                    "clock-offset",
                    "warning" if len(late) > FEW_SHARE * evidence.robust.samples else "info",
                    (camera, *numbers),
                    _problem_sentence(camera, late),
                    do,
                )
            )
    return found


def _late_samples(evidence: Evidence, camera: str, samples: set[int]) -> list[_Late]:
    """Images of a camera that a delay explains, by sample; the delay is the mean over the targets in the image."""
    delays: dict[int, list[float]] = {}
    for group in evidence.recorded.groups:
        rows = np.flatnonzero(np.isin(group.sample, list(samples)))
        if group.camera != camera or group.motion is None or not len(rows):
            continue
        views = group.take(rows).without_stops()
        state = evidence.solution.state
        predicted = state.camera_from_target(views, evidence.recorded.stops)
        view = views.measurement.linearise(predicted, state.cameras.get(camera), False)
        cost = spectrum(view.information, VIEW_ROUNDING).squared_mahalanobis(view.gradient)
        assert views.motion is not None
        gradient_s = np.einsum("ni,ni->n", view.gradient, views.motion)
        per_s2 = np.einsum("ni,nij,nj->n", views.motion, view.information, views.motion)
        delay_s = -gradient_s / np.maximum(per_s2, 1e-300)
        is_late = (-delay_s * gradient_s > _EXPLAINED_SHARE * cost) & (np.abs(delay_s) < _LONGEST_S)
        for k in np.flatnonzero(is_late):
            delays.setdefault(int(views.sample[k]), []).append(float(delay_s[k]))
    return [_Late(sample, float(np.mean(delays[sample]))) for sample in sorted(delays)]


def _problem_sentence(camera: str, late: list[_Late]) -> str:
    is_single = len(late) == 1
    delays = ", ".join(
        f"{two_digits(1e3 * abs(each.delay_s))} ms {'late' if each.delay_s > 0 else 'early'}"
        for each in late[:_SHOWN_IMAGES]
    )
    more = ", ..." if len(late) > _SHOWN_IMAGES else ""
    images = "An image" if is_single else f"{len(late)} images"
    stamps = "was not taken at the time of its stamp" if is_single else "were not taken at the times of their stamps"
    listed = f"{list_samples([each.sample for each in late])} ({delays}{more})"
    return f"{images} of {camera} {stamps}, and {'is' if is_single else 'are'} left out: {listed}."
