"""Errors of a moving arm that are a smooth function of time: nearly equal at close instants.

A servo lags its path, and a controller reports its pose, with errors that last for about one second. Images on a path
are taken more often. With independent errors for each stop, such images would count as independent errors. The model
is a Gaussian process over time with an exponential kernel, reduced to its leading modes. These modes must be as fast as
the paths: slower modes alone leave apparent errors by posture. Source: Uhlenbeck & Ornstein 1930; Rasmussen & Williams
2006 (4.2).
"""

from __future__ import annotations

import numpy as np

from basecal.effects import smooth
from basecal.effects.faces.effect import DEGREE, Effect, RandomEffect, SimulatedFault
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.geometry import Array

LASTS_S = 1.0
"""Time after which the correlation is 1/e. Errors that last for 0.5 to 3 s are described equally well."""

_MOST_INSTANTS = 400  # from which the modes are computed; further instants are interpolated
_MOST_MODES = 96  # of each of six coordinates, which bounds the run time; enough for two minutes
_LEAST_MODE = 0.07  # share of the largest variance: modes faster than 0.6 Hz are noise of single stops


def errors(instants_s: Array) -> SharedErrors | None:
    """Errors of each coordinate by modes at instants, (n,) [s]; zero at NaN instants, None if all are NaN."""
    is_moving = np.isfinite(instants_s)
    if not is_moving.any():
        return None
    unique_s = np.unique(instants_s[is_moving])
    modes = smooth.Modes.strongest(unique_s, kernel, _MOST_INSTANTS, _MOST_MODES, _LEAST_MODE)
    values = np.zeros((len(instants_s), modes.weights.shape[1]))
    values[is_moving] = modes.values(instants_s[is_moving])
    return SharedErrors.repeat_coordinates(values)


def kernel(first_s: Array, second_s: Array) -> Array:
    """Correlation of errors between instants, (n,) and (m,) to (n, m); 1 between equal instants."""
    return np.asarray(np.exp(-np.abs(first_s[:, None] - second_s) / LASTS_S))


EFFECT = Effect(
    "smooth_in_time",
    random=RandomEffect(
        SharedPrior(
            (2e-4, 4.0),
            "assumed: arms follow their paths to 0.02 to 0.5 mm",
            is_over_stop=False,
            lever=(None, 2.0),
        ),
        "smooth over {lasts_s:g} s while it moves",
        by_times=errors,
        is_by_coordinate=True,
        figures={"lasts_s": LASTS_S},
    ),
    fault=SimulatedFault(
        "following-error", "deg", DEGREE, 0.01, "joints deviate from their path during moves, one sigma"
    ),
    absent={face: why for face, why in smooth.ABSENT.items() if face != "fault"},
)
