"""The error of a lens that is stated without sigmas: that of a usual calibration, or as large as the data show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics
from basecal.effects.registry import LENS_PARAMETERS
from basecal.geometry import Array, Camera

_STUDENT_FREEDOMS = 3.0  # of Student's t: one lens of twenty is off by more than three times these; assumed
_MOST_ROUNDS = 100  # at most; assumed: bounds the time
# Relative change of a variance in a round, each of which closes a third of the gap or more; assumed.
_CONVERGED_CHANGE = 0.01


def with_usual_error(lens: Intrinsics) -> Intrinsics:
    """A lens that is stated without sigmas as a prior with those of a usual calibration; others as they are."""
    if not is_stated(lens) or lens.camera is None:
        return lens
    return replace(lens, status="prior", sigma=usual_sigmas(lens.camera))


def is_stated(lens: Intrinsics | None) -> bool:
    """Whether a lens is stated without sigmas, and not as exact."""
    return lens is not None and lens.status == "fixed" and not lens.exact


def usual_sigmas(camera: Camera) -> Array:
    """Usual sigmas of a calibration's focal lengths, principal point and distortion terms, (4 + k,)."""
    return np.concatenate([part.usual(camera) for part in LENS_PARAMETERS.values()])


def likely_sigmas(lens: Intrinsics, camera: Camera, covariance: Array) -> Array:
    """Sigmas of the errors of a stated lens, given the data, (4 + k,): the usual ones or larger.

    The errors of each block are Student's t. This is a normal whose variance is estimated by the mean of the squares
    that are expected of the errors, given the data. Estimate and covariance follow from those with the present sigmas
    to first order, all else as it is. Source: Dempster, Laird & Rubin 1977 (expectation maximisation).

    Args:
        lens: With the sigmas in use.
        camera: As estimated with these.
        covariance: Of its parameters, (4 + k, 4 + k).
    """
    assert lens.camera is not None
    assert lens.sigma is not None
    usual = usual_sigmas(lens.camera)
    off, known = (camera.parameters - lens.camera.parameters) / usual, covariance / np.outer(usual, usual)
    used = (lens.sigma / usual) ** 2
    variances = used
    for _ in range(_MOST_ROUNDS):
        gain = np.linalg.inv(np.eye(len(off)) + known * (1 / variances - 1 / used))
        before, variances = variances, _expected_variances((gain @ off) ** 2 + np.diag(gain @ known))
        if np.allclose(variances, before, rtol=_CONVERGED_CHANGE):
            break
    return np.asarray(usual * np.sqrt(variances))


def _expected_variances(squares: Array) -> Array:
    """Expected variances of the errors in units of the usual sigmas, (4 + k,), at least 1."""
    ratios = []
    for part in LENS_PARAMETERS.values():
        of = squares[part.where]
        of = of if part.is_each_alone else np.full(len(of), of.mean())
        freedoms = 1 if part.is_each_alone else len(of)
        ratios.append((_STUDENT_FREEDOMS + freedoms * of) / (_STUDENT_FREEDOMS + freedoms))
    return np.asarray(np.maximum(np.concatenate(ratios), 1.0))
