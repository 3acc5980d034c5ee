"""Which recorded poses are of one stop: a pose read back anew differs a little each time, and an arm may come again.

The error of an arm belongs to its pose. Poses that agree as read-backs of one place do therefore share it, whenever
they were taken. As separate stops they would seem independent. Within a stated noise that is larger, only poses one
after another are one place: of hundreds of places some are as near by chance.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array, IntArray

# [m, rad]: encoders and their filters let a pose that is read back vary by up to 20 um and as many urad a metre, 1
# sigma; this is five times the sigma of a difference. No two places to which an arm is sent on purpose are as near.
# Assumed: smaller ones split stops of an arm that stands, larger ones join near places.
READ_BACK = 1.4e-4


def stop_numbers(base_from_flange: SE3, joints: Array | None, noise: Array | None) -> IntArray:
    """The stop of each pose, (n,), in the order in which they were taken, numbered as they first appear.

    Args:
        base_from_flange: (n,) recorded poses.
        joints: (n, k) [rad], where recorded: one pose by other joints is another stop.
        noise: (6,) stated sigmas of the poses [m, rad]; places nearer than these are no places of their own.
    """
    angles = [base_from_flange.rotation.reshape(-1, 9), *([] if joints is None else [joints])]
    coordinates = np.concatenate([base_from_flange.translation, *angles], axis=-1)
    is_angle = np.arange(coordinates.shape[1]) >= 3
    stated = np.zeros(6) if noise is None else noise
    limit = np.maximum(READ_BACK, np.where(is_angle, stated[3:].min(), stated[:3].min()))
    starts, of_start = np.unique(_runs(coordinates / limit), return_inverse=True)
    first = _first_visits(coordinates[starts] / READ_BACK)[of_start]
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def _first_visits(places: Array) -> IntArray:
    """The first of the rows, (n, k), within 1 in every coordinate that is not near another before."""
    _, at, same = np.unique(places, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(at)
    first, distinct = at[order], places[at[order]]  # as they first appear
    owner = np.arange(len(distinct))
    near = _near_pairs(distinct)
    for early, late in near[np.lexsort((near[:, 0], near[:, 1]))]:
        if owner[early] == early and owner[late] == late:
            owner[late] = early
    return np.asarray(first[owner[np.argsort(order)[same.ravel()]]], dtype=np.int64)


def _near_pairs(places: Array) -> IntArray:
    """Pairs of rows (n, k), the lower one first, that are within 1 of each other in every coordinate, (m, 2).

    Along the coordinate that spreads most hardly any others are within 1.
    """
    along = places[:, np.argmax(np.ptp(places, axis=0))]
    order = np.argsort(along)
    behind = np.searchsorted(along[order], along[order] + 1, side="right") - np.arange(len(order)) - 1
    one = np.repeat(np.arange(len(order)), behind)
    other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(behind) - behind, behind)
    pairs = np.sort(order[np.stack([one, other], axis=1)], axis=1)
    return np.asarray(pairs[np.all(np.abs(places[pairs[:, 0]] - places[pairs[:, 1]]) <= 1, axis=1)], dtype=np.int64)


def _runs(places: Array) -> IntArray:
    """The first row of each row's run, (n, k): all of a run are within 1 of it in every coordinate."""
    first = np.arange(len(places))
    near = np.all(np.abs(places[1:] - places[:-1]) <= 2, axis=-1)  # without that a run has ended anyhow
    for row in np.flatnonzero(near) + 1:
        if np.all(np.abs(places[row] - places[first[row - 1]]) <= 1):
            first[row] = first[row - 1]
    return first.astype(np.int64)
