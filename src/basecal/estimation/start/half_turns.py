"""Which views of a grid that looks the same turned by half a turn were read from its other end.

If one robot alone moved between two views, it and the target rotated by the same angle, whatever the mounts are. Views
are read so that angles agree over all pairs. If no pair decides, each is read with the least rotation against the
first. `benchmarks.starts` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.start.rotation_search import HOPELESS_RAD, rotation_angle
from basecal.geometry import Array, BoolArray

_DESCENT_ROUNDS = 20
_LEAST_GAIN_RAD = 1e-6


def turned_views(group: ViewGroup, read: Array, mask: Array) -> BoolArray:
    """Which views to read from the other end, (n,), given the target's rotations read both ways, (n, 3, 3) each."""
    alike = np.einsum("nij,ij->n", read, read[0])
    turn = np.einsum("nij,ij->n", mask, read[0]) > alike
    # Where one robot moved between views and the other stood still, by how much the target turned is known.
    eye_still, hand_still = (stand[:, None] == stand[None] for stand in (group.eye.stand, group.hand.stand))
    told = np.asarray((eye_still != hand_still) & ~np.eye(len(group), dtype=bool))
    if not told.any():
        return np.asarray(turn)
    eye, hand = group.eye.base_from_flange.rotation, group.hand.base_from_flange.rotation
    of_eye, of_hand = (rotation_angle(r[:, None], r) for r in (eye, hand))
    angle = np.where(hand_still, of_eye, of_hand)
    # How far off is view i read the way s from view j read the way t, (i, s, j, t) [rad].
    both = np.stack([read, mask], 1)
    between = rotation_angle(both[:, :, None, None], both)
    misfit = np.minimum(np.abs(between - angle[:, None, :, None]), HOPELESS_RAD) * told[:, None, :, None]
    turn = _descend_readings(misfit, turn.astype(np.int64))
    first = _descend_readings(misfit, np.argmin(misfit[:, :, 0, 0], axis=1))
    rows = np.arange(len(turn))
    return min((turn, first), key=lambda t: float(misfit[rows, t][:, rows, t].sum())).astype(bool)


def _descend_readings(misfit: Array, turn: Array) -> Array:
    """The readings, (n,), from which no single view gains by being read otherwise."""
    turn, rows = turn.copy(), np.arange(len(turn))
    for _ in range(_DESCENT_ROUNDS * len(turn)):
        both = misfit[:, :, rows, turn].sum(-1)
        gain = both[rows, turn] - both.min(-1)
        most = int(np.argmax(gain))
        if gain[most] < _LEAST_GAIN_RAD:
            break
        turn[most] = 1 - turn[most]
    return turn
