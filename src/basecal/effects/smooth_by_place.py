"""Errors of an arm that are a smooth function of the flange's position, along the axes of its base.

A wrong scale of an axis, a wrong link length or elasticity shifts close poses nearly equally. The base absorbs most of
such an error, so that the residuals show little of it. Of twelve recordings of arms with recorded poses, six have more
evidence for this effect than for `smooth`, three have less.
"""

from __future__ import annotations

import numpy as np

from basecal.effects import smooth
from basecal.effects.faces.effect import Effect, RandomEffect
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.geometry import SE3, Array


def errors(recorded_poses: SE3, poses: SE3) -> SharedErrors | None:
    """Errors along each axis of the base at poses, (n,), by modes of recorded poses, (m,)."""
    modes = smooth.Modes.strongest(recorded_poses, kernel).values(poses)
    return SharedErrors.repeat_coordinates(modes).rotate_to(poses) if modes.shape[1] else None


def kernel(first: SE3, second: SE3) -> Array:
    """Correlation of errors between flange poses, (n,) and (m,) to (n, m); 1 between equal positions."""
    difference = first.translation[:, None] - second.translation[None]
    return smooth.correlation(np.sum(difference**2, -1))


EXPECTED = SharedPrior(
    (8e-4, 3.0), "accuracy of 0.5 to 2 mm of arms as delivered (Nubiola & Bonev 2013)", is_over_stop=False
)
"""Prior of fields of errors of an arm that records only poses."""

EFFECT = Effect(
    "smooth_by_place",
    random=RandomEffect(
        EXPECTED,
        "smooth over {length_m:g} m of place, along the axes of its base",
        by_poses=errors,
        is_by_coordinate=True,
        figures=smooth.FIGURES,
    ),
    absent=smooth.ABSENT,
)
