"""Why a view or a point was left out, in words."""

from __future__ import annotations

import numpy as np

from basecal.cell import Outlier
from basecal.estimation.outliers.left_out import LeftOut

_LARGEST_SIGMAS = 1000.0  # sigmas, beyond which the number says no more


def described_outlier(outlier: LeftOut) -> Outlier:
    """The entry of a calibration for an excluded item."""
    return Outlier(outlier.sample, outlier.camera, outlier.target, outlier.ids, outlier_reason(outlier))


def outlier_reason(outlier: LeftOut) -> str:
    """How far it is from where the rest predicts it, and what that may come from."""
    if outlier.ids:
        which = "point is" if len(outlier.ids) == 1 else f"{len(outlier.ids)} points are up to"
        cause = "a reflection, a wrong id or occluded"
        beyond = f" ({_sigmas(outlier.sigmas)})" if np.isfinite(outlier.sigmas) else ""
        return f"{which} {_distance(outlier, 3)}{beyond} from where the rest predicts it: {cause}"
    by = f" by {_sigmas(outlier.sigmas)}" if np.isfinite(outlier.sigmas) else ""
    if outlier.off_m is not None and outlier.off_rad is not None:
        off = f"{1e3 * outlier.off_m:.1f} mm and {np.degrees(outlier.off_rad):.2f} deg"
        cause = "a robot bumped or not settled, or poses and view of different instants"
        return f"the robots' poses and the view disagree{by}, {off}: {cause}"
    if outlier.off_m is not None:
        cause = "another point, or one that moved; or a robot bumped or not settled"
        return f"{outlier.target} is {_distance(outlier, 3)} from where the rest predicts it{by}: {cause}"
    place = f"seen {_distance(outlier, 0)} from where the rest predicts it{by}"
    return f"{place}: a reflection, or a robot bumped or not settled"


def _distance(outlier: LeftOut, digits: int) -> str:
    value, unit = (outlier.off_px, "px") if outlier.off_m is None else (1e3 * outlier.off_m, "mm")
    if value is None or not np.isfinite(value):
        return "far"
    return f"{value:.{digits}g} {unit}" if digits else f"{value:.0f} {unit}"


def _sigmas(sigmas: float) -> str:
    return f"more than {_LARGEST_SIGMAS:.0f} sigma" if sigmas > _LARGEST_SIGMAS else f"{sigmas:.0f} sigma"
