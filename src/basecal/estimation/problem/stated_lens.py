"""Error of a lens that is stated without sigmas: that of a typical calibration, or larger if the data show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import Intrinsics
from basecal.effects.registry import LENS_PARAMETERS
from basecal.geometry import Array, Camera

# Degrees of freedom of Student's t: errors of one lens in twenty exceed three times the usual sigmas; assumed.
_STUDENT_FREEDOMS = 3.0
_MOST_ROUNDS = 100  # most iterations; assumed: bounds the time
# Relative change of a variance at convergence; each iteration reduces the distance by a third or more; assumed.
_CONVERGED_CHANGE = 0.01


def with_usual_error(lens: Intrinsics) -> Intrinsics:
    """Convert a lens stated without sigmas to a prior with the sigmas of a typical calibration; keep other lenses."""
    if not is_stated(lens) or lens.camera is None:
        return lens
    return replace(lens, status="prior", sigma=usual_sigmas(lens.camera))


def is_stated(lens: Intrinsics | None) -> bool:
    """Whether a lens is stated without sigmas and not marked as exact."""
    return lens is not None and lens.status == "fixed" and not lens.exact


def usual_sigmas(camera: Camera) -> Array:
    """Typical sigmas of calibrated focal lengths, principal point and distortion terms, (4 + k,)."""
    return np.concatenate([part.typical_sigmas(camera) for part in LENS_PARAMETERS.values()])


def likely_sigmas(lens: Intrinsics, camera: Camera, covariance: Array) -> Array:
    """Sigmas of the errors of a stated lens, given the data, (4 + k,); at least the typical sigmas.

    The errors of each block follow Student's t, which is a normal distribution of unknown variance. The variance is
    the mean of the expected squares of the errors, given the data. The estimate and covariance under new sigmas follow
    from those under the present sigmas to first order. Source: Dempster, Laird & Rubin 1977 (expectation
    maximisation).

    Args:
        lens: Stated lens with the sigmas in use.
        camera: Lens estimated with these sigmas.
        covariance: Covariance of the estimated parameters, (4 + k, 4 + k).
    """
    assert lens.camera is not None
    assert lens.sigma is not None
    usual = usual_sigmas(lens.camera)
    errors = (camera.parameters - lens.camera.parameters) / usual
    relative_covariance = covariance / np.outer(usual, usual)
    used_variances = (lens.sigma / usual) ** 2
    variances = used_variances
    for _ in range(_MOST_ROUNDS):
        gain = np.linalg.inv(np.eye(len(errors)) + relative_covariance * (1 / variances - 1 / used_variances))
        previous, variances = variances, _expected_variances((gain @ errors) ** 2 + np.diag(gain @ relative_covariance))
        if np.allclose(variances, previous, rtol=_CONVERGED_CHANGE):
            break
    return np.asarray(usual * np.sqrt(variances))


def _expected_variances(squares: Array) -> Array:
    """Expected variances of the errors, relative to the squared typical sigmas, (4 + k,); at least 1."""
    ratios = []
    for part in LENS_PARAMETERS.values():
        block = squares[part.indices]
        block = block if part.is_each_alone else np.full(len(block), block.mean())
        freedoms = 1 if part.is_each_alone else len(block)
        ratios.append((_STUDENT_FREEDOMS + freedoms * block) / (_STUDENT_FREEDOMS + freedoms))
    return np.asarray(np.maximum(np.concatenate(ratios), 1.0))
