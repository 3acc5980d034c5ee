"""Errors that the views of a camera share at each sample, estimated from the samples.

Views count as independent, except for the errors of robots and the uncertainty of the calibration. The views of one
camera may share further errors: a lens that is slightly wrong at the targets' positions, image blur, or a shaking
stand. Such errors show in many samples: their estimates of the camera's pose scatter by more than their covariance. If
the excess is beyond chance, the camera's pose counts as uncertain by as much, in the new samples and in the calibrated
ones.
Source: the covariance of estimates from clusters, Liang & Zeger 1986; the largest eigenvalue of noise, Marchenko &
Pastur 1967; docs/mathematics.md (13.5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.drift.innovations import Innovations
from basecal.accuracy.drift.shifts import Shift
from basecal.geometry import Array
from basecal.numerics.spectral import scaled_spectrum, spectrum

FEWEST_SAMPLES = 12
"""Whose scatter tells anything: six numbers of each."""

_HIDDEN_SHARE = 1e-9  # share of the information below which a direction of a camera's place is not seen


def with_shared_errors(innovations: Innovations, shift: Shift) -> Innovations:
    """A copy with the errors that the views of each camera share.

    Args:
        innovations: New views, of `FEWEST_SAMPLES` or more.
        shift: The likeliest thing to have moved, which is none of such errors.
    """
    if shift.joint is None:
        moves = innovations.frame_jacobian(shift.transform)
    else:
        moves = innovations.joint_jacobian(shift.frame.removesuffix("_flange"))[..., shift.joint : shift.joint + 1]
    left = innovations.covariance_inverse @ (innovations.off - innovations.whiten(moves) @ shift.size)
    cameras = sorted({group.eye.mount for group in innovations.situation.problem.groups})
    more = sum(
        (
            _camera_covariance(innovations, innovations.whiten(innovations.frame_jacobian(name)), left)
            for name in cameras
        ),
        np.zeros(innovations.predicted.shape),
    )
    return (
        innovations
        if not np.any(more)
        else replace(innovations, predicted=innovations.predicted + more, known_inverse=None)
    )


def _camera_covariance(innovations: Innovations, place_jacobian: Array, residual: Array) -> Array:
    """Covariance of all views of a camera by their shared errors, (6 n, 6 n).

    Args:
        innovations: The views.
        place_jacobian: (6 n, 6) how they go with the camera's place.
        residual: (6 n,) what is left of them over its covariance.
    """
    inverse = innovations.covariance_inverse
    rows = [np.flatnonzero(np.repeat(innovations.sample == number, 6)) for number in np.unique(innovations.sample)]
    said = np.stack([place_jacobian[at].T @ residual[at] for at in rows])
    expected = sum(
        (place_jacobian[at].T @ inverse[np.ix_(at, at)] @ place_jacobian[at] for at in rows), np.zeros((6, 6))
    )
    of_all = spectrum(expected, _HIDDEN_SHARE)
    by_chance = (1 + np.sqrt(place_jacobian.shape[1] / len(rows))) ** 2
    scatter = scaled_spectrum(of_all.inverse_root.T @ (said.T @ said) @ of_all.inverse_root, by_chance)
    beyond = np.where(scatter.held, scatter.values - 1, 0.0)
    moved = place_jacobian @ (of_all.inverse_root @ scatter.vectors * np.sqrt(beyond))
    together = moved @ moved.T
    for at in rows:
        together[np.ix_(at, at)] *= 1 + len(rows)
    return np.asarray(together)
