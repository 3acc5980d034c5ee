"""Descriptions of outliers, with their size and likely cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import PurePath

import numpy as np

from basecal.cell import Outlier
from basecal.estimation.outliers.left_out import LeftOut
from basecal.fields.digits import two_digits

_LARGEST_SIGMAS = 1000.0  # sigmas above which the exact number is not shown; assumed
_SHOWN_OUTLIERS = 5  # outliers that a finding lists, the first with its cause; assumed
_WRONG_POINT = "a reflection, a wrong id or occlusion"

Images = Mapping[tuple[int, str], str]


def outlier_entry(outlier: LeftOut, images: Images) -> Outlier:
    """Outlier entry of a calibration; `images` are the paths of images, by sample number and camera."""
    image = images.get((outlier.sample, outlier.camera))
    return Outlier(outlier.sample, outlier.camera, outlier.target, outlier.ids, outlier_reason(outlier), image)


def name_sample(number: int, image: str | None) -> str:
    """Name a sample with the file name of its image, if there is one: "sample 11 (IMG_12.png)"."""
    return f"sample {number}" if image is None else f"sample {number} ({PurePath(image).name})"


def list_outliers(outliers: Sequence[LeftOut], images: Images) -> str:
    """Describe outliers in sentences: the reason of the first, and the sizes of the next few."""
    places = [name_sample(o.sample, images.get((o.sample, o.camera))) for o in outliers]
    sentences = [f"At {places[0]}, {outlier_reason(outliers[0])}."]
    for place, outlier in zip(places[1:_SHOWN_OUTLIERS], outliers[1:_SHOWN_OUTLIERS], strict=False):
        sentences.append(f"S{place[1:]}: {_size(outlier)}.")
    if len(outliers) > _SHOWN_OUTLIERS:
        sentences.append("The others are listed under `outliers` in calibration.json.")
    return " ".join(sentences)


def outlier_reason(outlier: LeftOut) -> str:
    """Describe the distance of an outlier from its prediction, and the likely cause."""
    cause = "a robot bumped or not settled"
    size = _sigmas(outlier.sigmas) if np.isfinite(outlier.sigmas) else ""
    off = _distance(outlier) + (f" ({size})" if size else "")
    if len(outlier.ids) == 1:
        return f"a point is {off} from its prediction: {_WRONG_POINT}"
    if outlier.ids:
        return f"{len(outlier.ids)} points are up to {off} from their predictions: {_WRONG_POINT}"
    if outlier.off_m is not None and outlier.off_rad is not None:
        excess = f" by {size}" if size else ""
        apart = f"{two_digits(1e3 * outlier.off_m)} mm and {two_digits(np.degrees(outlier.off_rad))} deg"
        words = f"the robots' poses and the view disagree{excess}, {apart}"
        return f"{words}: {cause}, or poses and view of different instants"
    if outlier.off_m is not None:
        return f"{outlier.target} is {off} from its prediction: another point, or one that moved; or {cause}"
    return f"{outlier.target} is {off} from its prediction: a reflection, or {cause}"


def _size(outlier: LeftOut) -> str:
    """Describe the distance of an outlier from its prediction, without the cause."""
    count = f"{len(outlier.ids)} points, up to " if len(outlier.ids) > 1 else ""
    angle = "" if outlier.off_rad is None else f" and {two_digits(np.degrees(outlier.off_rad))} deg"
    beyond = f" ({_sigmas(outlier.sigmas)})" if np.isfinite(outlier.sigmas) else ""
    return f"{count}{_distance(outlier)}{angle}{beyond}"


def _distance(outlier: LeftOut) -> str:
    value, unit = (outlier.off_px, "px") if outlier.off_m is None else (1e3 * outlier.off_m, "mm")
    if value is None or not np.isfinite(value):
        return "far"
    return f"{two_digits(value)} {unit}"


def _sigmas(sigmas: float) -> str:
    return f"more than {_LARGEST_SIGMAS:.0f} sigma" if sigmas > _LARGEST_SIGMAS else f"{sigmas:.0f} sigma"
