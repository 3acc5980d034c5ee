"""Which recorded poses are of one stop: a pose read back anew differs a little each time, and an arm may come again.

The error of an arm belongs to the place where it stands, so that poses which agree as read-backs of one place do share
it, whenever they were taken. Taken for stops of their own they would seem to vouch for one another.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array, IntArray

# Encoders and their filters let a pose that is read back vary by up to 20 um and as many urad a metre, 1 sigma; this
# is five times the sigma of a difference. No two places to which an arm is sent on purpose are as near.
READ_BACK_M = 1.4e-4
READ_BACK_RAD = 1.4e-4


def stop_numbers(base_from_flange: SE3, joints: Array | None, noise: Array | None) -> IntArray:
    """The stop of each pose, (n,), numbered as they first appear: the first of a stop has all others near it.

    Args:
        base_from_flange: (n,) recorded poses.
        joints: (n, k) [rad], where recorded: one pose by other joints is another stop.
        noise: (6,) stated sigmas of the poses [m, rad]; places nearer than these are no places of their own.
    """
    stated = np.zeros(6) if noise is None else noise
    near_m, near_rad = max(READ_BACK_M, float(stated[:3].min())), max(READ_BACK_RAD, float(stated[3:].min()))
    rotation = base_from_flange.rotation.reshape(-1, 9)
    parts = [base_from_flange.translation / near_m, rotation / near_rad]
    if joints is not None:
        parts.append(joints / near_rad)
    return _numbered(np.concatenate(parts, axis=-1))


def _numbered(places: Array) -> IntArray:
    """Groups of rows, (n, k), within 1 of their first in every coordinate, numbered in order."""
    first = np.arange(len(places))
    alone = _alone(places)
    waiting = ~alone
    while waiting.any():
        at = int(np.argmax(waiting))
        same = waiting & np.all(np.abs(places - places[at]) <= 1, axis=-1)
        first[same] = at
        waiting &= ~same
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def _alone(places: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Rows that no other is near to in their first coordinate, (n,): most, where an arm moves."""
    order = np.argsort(places[:, 0])
    apart = np.concatenate([[True], np.diff(places[order, 0]) > 1, [True]])
    alone = np.empty(len(places), dtype=bool)
    alone[order] = apart[:-1] & apart[1:]
    return alone
