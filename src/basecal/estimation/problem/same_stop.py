"""Which recorded poses are of one stop: a pose read back anew differs a little each time, and an arm may come again.

The error of an arm belongs to the place where it stands, so that poses share it which one after another agree as
read-backs of one place do, or which are equal, whenever they were taken. Taken for stops of their own they would seem
to vouch for one another. Poses that agree only nearly, with others between them, are places of their own.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array, IntArray

# Encoders and their filters let a pose that is read back vary by up to 20 um and as many urad a metre, 1 sigma; this
# is five times the sigma of a difference. No two places to which an arm is sent on purpose are as near.
READ_BACK_M = 1.4e-4
READ_BACK_RAD = 1.4e-4


def stop_numbers(base_from_flange: SE3, joints: Array | None, noise: Array | None) -> IntArray:
    """The stop of each pose, (n,), in the order in which they were taken, numbered as they first appear.

    Args:
        base_from_flange: (n,) recorded poses.
        joints: (n, k) [rad], where recorded: one pose by other joints is another stop.
        noise: (6,) stated sigmas of the poses [m, rad]; places nearer than these are no places of their own.
    """
    stated = np.zeros(6) if noise is None else noise
    near_m, near_rad = max(READ_BACK_M, float(stated[:3].min())), max(READ_BACK_RAD, float(stated[3:].min()))
    parts = [base_from_flange.translation / near_m, base_from_flange.rotation.reshape(-1, 9) / near_rad]
    if joints is not None:
        parts.append(joints / near_rad)
    places = np.concatenate(parts, axis=-1)
    first = _runs(places)
    _, same = np.unique(places[first], axis=0, return_inverse=True)
    _, at, number = np.unique(same.ravel(), return_index=True, return_inverse=True)
    return np.argsort(np.argsort(at))[number].astype(np.int64)


def _runs(places: Array) -> IntArray:
    """Of each row, (n, k), the first of its run: all of a run are within 1 of it in every coordinate."""
    first = np.arange(len(places))
    near = np.all(np.abs(places[1:] - places[:-1]) <= 2, axis=-1)  # without that a run has ended anyhow
    for row in np.flatnonzero(near) + 1:
        if np.all(np.abs(places[row] - places[first[row - 1]]) <= 1):
            first[row] = first[row - 1]
    return first.astype(np.int64)
