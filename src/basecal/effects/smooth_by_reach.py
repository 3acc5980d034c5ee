"""Errors of an arm that are a smooth function of the reach and height of its flange, along the axes of the arm.

The first joint of an arm rotates about the z axis of its base. Errors of links, other joints and weight are therefore
equal at equal reach and height, in axes that rotate with the arm. In addition the arm bends in proportion to its reach.
Of nine recordings of arms with recorded poses, three have the most evidence for this effect, four for `smooth`, and two
for no shared error.
"""

from __future__ import annotations

import numpy as np

from basecal.effects import smooth
from basecal.effects.bending import turns_by_reach
from basecal.effects.faces.effect import Effect, RandomEffect
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.effects.smooth_by_place import EXPECTED
from basecal.geometry import SE3, Array


def errors(recorded_poses: SE3, poses: SE3) -> SharedErrors | None:
    """Errors along the axes of the arm at poses, (n,), by modes of recorded poses, (m,), and by its bend."""
    modes = smooth.Modes.strongest(recorded_poses, kernel).values(poses)
    if not modes.shape[1]:
        return None
    shared = SharedErrors.repeat_coordinates(modes).rotate_to(poses, _arm_axes(poses))
    by_stop = np.concatenate([shared.by_stop, turns_by_reach(poses)[..., 2:]], axis=-1)
    return SharedErrors(by_stop, np.append(shared.is_turn, True))


def kernel(first: SE3, second: SE3) -> Array:
    """Correlation of errors between flange poses, (n,) and (m,) to (n, m); 1 between equal reaches and heights."""
    difference = _reach_and_height(first)[:, None] - _reach_and_height(second)[None]
    return smooth.correlation(np.sum(difference**2, -1))


def _reach_and_height(poses: SE3) -> Array:
    x, y, z = poses.translation.T
    return np.stack([np.hypot(x, y), z], axis=-1)


def _arm_axes(poses: SE3) -> Array:
    """Outward, sideways and upward axes of an arm at poses, (n,), as columns in its base, (n, 3, 3)."""
    azimuth = np.arctan2(poses.translation[:, 1], poses.translation[:, 0])
    out = np.zeros((len(poses), 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = np.cos(azimuth)
    out[:, 1, 0] = np.sin(azimuth)
    out[:, 0, 1] = -out[:, 1, 0]
    out[:, 2, 2] = 1.0
    return out


EFFECT = Effect(
    "smooth_by_reach",
    random=RandomEffect(
        EXPECTED._replace(lever=(None, 4.0)),
        "smooth over {length_m:g} m of reach and height, along the axes of the arm",
        by_poses=errors,
        is_of_poses_alone=True,
        figures=smooth.FIGURES,
    ),
    absent=smooth.ABSENT,
)
