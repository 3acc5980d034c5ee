"""Errors of an arm that are smooth in the place of its flange, along the axes of its base.

A long axis, a long link or an arm that yields shifts poses that are near one another nearly equally. A base takes up
most of such an error, and little of it shows. Of twelve recordings of arms that record poses six have more evidence
for it than for `smooth`, three have less.
"""

from __future__ import annotations

import numpy as np

from basecal.effects import smooth
from basecal.effects.faces.effect import Effect, RandomEffect
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.geometry import SE3, Array


def errors(recorded_poses: SE3, poses: SE3) -> SharedErrors | None:
    """Errors along each axis by modes of recorded poses, (m,), at poses, (n,)."""
    found = smooth.Modes.strongest(recorded_poses, kernel).sizes(poses)
    return SharedErrors.repeat_coordinates(found).rotate_to(poses) if found.shape[1] else None


def kernel(first: SE3, second: SE3) -> Array:
    """Correlation of errors at poses of a flange, (n,) and (m,) to (n, m): 1 at one place."""
    apart = first.translation[:, None] - second.translation[None]
    return np.asarray(np.exp(-0.5 * np.sum(apart**2, -1) / smooth.LENGTH_M**2))


EXPECTED = SharedPrior(
    (8e-4, 3.0), "accuracy of 0.5 to 2 mm of arms as delivered (Nubiola & Bonev 2013)", is_over_stop=False
)
"""Of fields of errors of an arm that records poses alone."""

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
