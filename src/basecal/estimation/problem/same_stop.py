"""Assign recorded poses to stops: repeated read-backs of one pose differ slightly, and an arm may revisit a pose.

The error of an arm is a function of its pose. Poses that agree within the read-back noise therefore share one error,
even if they were recorded at different times. As separate stops, their errors would be treated as independent. If the
stated noise is larger than the read-back noise, poses within the stated noise share a stop only if they are
consecutive. Among hundreds of poses, some are this close by chance.
"""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array, IntArray

# [m, rad]: because of encoders and filters, repeated read-backs of one pose vary by up to 20 um and 20 urad per metre,
# 1 sigma; this is five times the sigma of a difference. Two poses that are commanded on purpose are farther apart.
# Assumed: smaller values split the stops of an arm at rest, larger values merge neighbouring poses.
READ_BACK = 1.4e-4


def stop_numbers(base_from_flange: SE3, joints: Array | None, noise: Array | None) -> IntArray:
    """Stop number of each pose, (n,), in order of first appearance.

    Args:
        base_from_flange: (n,) recorded poses, in the order of recording.
        joints: (n, k) [rad], or None; the same pose with different joints is a different stop.
        noise: (6,) stated sigmas of the poses [m, rad]; consecutive poses closer than these share one stop.
    """
    angles = [base_from_flange.rotation.reshape(-1, 9), *([] if joints is None else [joints])]
    coordinates = np.concatenate([base_from_flange.translation, *angles], axis=-1)
    is_angle = np.arange(coordinates.shape[1]) >= 3
    stated = np.zeros(6) if noise is None else noise
    limit = np.maximum(READ_BACK, np.where(is_angle, stated[3:].min(), stated[:3].min()))
    starts, start_of_pose = np.unique(_runs(coordinates / limit), return_inverse=True)
    first = _first_visits(coordinates[starts] / READ_BACK)[start_of_pose]
    return np.unique(first, return_inverse=True)[1].astype(np.int64)


def _first_visits(places: Array) -> IntArray:
    """Index of the first row, (n, k), within 1 of each row in every coordinate, (n,).

    A row that is assigned to an earlier one cannot have others assigned to itself.
    """
    _, first_index, distinct_row = np.unique(places, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first_index)
    first, distinct = first_index[order], places[first_index[order]]  # as they first appear
    owner = np.arange(len(distinct))
    near_pairs = _near_pairs(distinct)
    for early, late in near_pairs[np.lexsort((near_pairs[:, 0], near_pairs[:, 1]))]:
        if owner[early] == early and owner[late] == late:
            owner[late] = early
    return np.asarray(first[owner[np.argsort(order)[distinct_row.ravel()]]], dtype=np.int64)


def _near_pairs(places: Array) -> IntArray:
    """Pairs of rows (n, k) within 1 of each other in every coordinate, the lower index first, (m, 2).

    Candidates are neighbours within 1 in the coordinate of the largest spread, in which neighbours are few.
    """
    coordinate = places[:, np.argmax(np.ptp(places, axis=0))]
    order = np.argsort(coordinate)
    near_count = np.searchsorted(coordinate[order], coordinate[order] + 1, side="right") - np.arange(len(order)) - 1
    first_row = np.repeat(np.arange(len(order)), near_count)
    second_row = first_row + 1 + np.arange(len(first_row)) - np.repeat(np.cumsum(near_count) - near_count, near_count)
    pairs = np.sort(order[np.stack([first_row, second_row], axis=1)], axis=1)
    return np.asarray(pairs[np.all(np.abs(places[pairs[:, 0]] - places[pairs[:, 1]]) <= 1, axis=1)], dtype=np.int64)


def _runs(places: Array) -> IntArray:
    """First row of the run of each row, (n,): rows (n, k) of a run are within 1 of its first in every coordinate."""
    first = np.arange(len(places))
    may_continue = np.all(np.abs(places[1:] - places[:-1]) <= 2, axis=-1)  # any larger difference ends a run
    for row in np.flatnonzero(may_continue) + 1:
        if np.all(np.abs(places[row] - places[first[row - 1]]) <= 1):
            first[row] = first[row - 1]
    return first.astype(np.int64)
