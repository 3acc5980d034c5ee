"""Changes of a robot's parameters that its recorded joints do not distinguish from changes of other unknowns.

A joint that never moved rotates the arm as its base does, and so does the next one after it. The last joint rotates
what the flange carries as its mounts do. A rotation about a joint's own axis is that joint's offset. The poses of the
flange show which of these a recording leaves open; the arm alone does not. Nothing depends on a plate's rotation about
the line of its marks, or on a plane's motion within itself. Source: docs/mathematics.md, "Gauges".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Cell
from basecal.errors import InputError
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.contacts import GRIPS, ContactMeasurement
from basecal.estimation.view.points import is_touch
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, IntArray
from basecal.numerics.spectral import Spectrum, principal_axes, scaled_spectrum

# Motion of the flange by a radian of something, root of the mean square [rad], below which it is what the noise of
# recorded poses may make: real arms have some milliradians.
LEAST_RMS = 3e-3
LENGTH_M = 0.5  # length that counts as much as a radian: a lever arm of an arm's hand [m]
MOVE_SCALE = np.array([LENGTH_M] * 3 + [1.0] * 3)
_SHARE_DECIMALS = (
    6  # decimals of a joint's share in a gauge: equal ones differ by rounding, and then the first is taken
)


def end_moves(base_from_flange: SE3, free_ends: tuple[bool, bool]) -> Array:
    """How flanges, (m,), move with what is free at the ends of their arm, right tangents, (m, 6, k).

    Args:
        base_from_flange: (m,).
        free_ends: Whether its base, and whether all that its flange carries, are free.
    """
    at_base, at_flange = base_from_flange.inverse().adjoint(), np.broadcast_to(np.eye(6), (len(base_from_flange), 6, 6))
    ends = [each * MOVE_SCALE for each, free in zip((at_base, at_flange), free_ends, strict=True) if free]
    return np.concatenate([np.zeros((len(base_from_flange), 6, 0)), *ends], axis=-1)


def independent_moves(moves: Array, other_moves: Array) -> Spectrum:
    """Mean squares of a flange's moves that others cannot absorb, along directions of the moves [rad^2].

    Args:
        moves: (m, 6, k) right tangents by one unit of each [m, rad].
        other_moves: (m, 6, j) likewise.
    """
    flat, by_others = _flatten_moves(moves), _flatten_moves(other_moves)
    across = scaled_spectrum(by_others.T @ by_others, LEAST_RMS**2).inverse_root.T @ (by_others.T @ flat)
    return scaled_spectrum(flat.T @ flat - across.T @ across, LEAST_RMS**2)


def _flatten_moves(moves: Array) -> Array:
    """Rows of all flanges, 0.5 m counting as a radian, whose sums of squares are means over the flanges."""
    rows = moves / MOVE_SCALE[:, None]
    return np.asarray(rows.reshape(6 * len(moves), moves.shape[-1]) / np.sqrt(max(len(moves), 1)))


def determined_directions(moves: Array, other_moves: Array) -> Array:
    """An orthonormal basis, (k, r), of what of some moves is none of the others; see `independent_moves`."""
    left = independent_moves(moves, other_moves)
    return np.asarray(left.vectors[:, left.held])


def determined_joints(moves: Array, other_moves: Array) -> IntArray:
    """Which of some moves, one of each joint, are not to be held so that the rest is none of the others.

    Of joints with an equal part in a gauge the first is held.
    """
    of = independent_moves(moves, other_moves)
    left, held = of.vectors[:, ~of.held], list[int]()
    for _ in range(left.shape[1]):
        share = np.round(np.linalg.norm(left, axis=-1), _SHARE_DECIMALS)
        held.append(int(np.argmax(share)))
        along = left[held[-1]] / np.linalg.norm(left[held[-1]])
        left = left - np.outer(left @ along, along)
    return np.setdiff1d(np.arange(moves.shape[-1]), np.array(held, dtype=np.int64))


def held_gauges(cell: Cell, groups: Sequence[ViewGroup]) -> dict[str, Array]:
    """Directions of tangents that are held, of each transform that has some and is not fixed: 1, else 0, (6,)."""
    found = {cell.plate_name(plate): _line_rotation(cell, plate) for plate in cell.plates}
    for group in groups:
        if isinstance(group.measurement, ContactMeasurement):
            found[group.eye.mount] = np.array(group.measurement.camera_gauge, dtype=np.float64)
            found[group.hand.mount] = np.array(group.measurement.target_gauge, dtype=np.float64)
    unknowns = cell.transforms
    return {name: of for name, of in found.items() if of.any() and unknowns[name].status != "fixed"}


def _line_rotation(cell: Cell, plate: str) -> Array:
    """The rotation of a plate about the line that all its marks are on, if they are."""
    places = [target.mount.mean for target in cell.targets.values() if target.on == plate]
    points = np.array([at.translation for at in places if at is not None])
    of, held = principal_axes(points - points.mean(0)), np.zeros(6)
    if of.dimension == 1:
        held[3 + int(np.argmax(np.abs(of.axes[:, 0])))] = 1.0
    return held


def point_mounts(cell: Cell, groups: Sequence[ViewGroup]) -> frozenset[str]:
    """Names of the mounts of single points, but of those that were measured as poses: their orientation counts.

    Raises:
        InputError: if a point that was measured as poses is seen as a point, too, or its mount is stated, which has no
            rotation then.
    """
    points = {t.name for t in cell.targets.values() if t.target is not None and t.target.is_point}
    posed = {g.target for g in groups if isinstance(g.measurement, PoseMeasurement)} & points
    seen = {g.target for g in groups if not isinstance(g.measurement, PoseMeasurement)}
    for target in sorted(posed):
        if target in seen or cell.targets[target].mount.status != "free":
            raise InputError(
                f"target {target!r} is one point, which has no orientation, and is observed by `camera_from_target`. "
                "Leave out its `kind` and state its mount with a rotation. Views of the point itself are of another "
                "target"
            )
    return frozenset(map(cell.mount_name, (points - posed) | _tips(groups)))


def _tips(groups: Sequence[ViewGroup]) -> set[str]:
    """Tips that see points at their own origin only: no rotation of such a mount matters."""
    return {g.camera for g in groups} - {
        g.camera for g in groups if not is_touch(g.measurement) or isinstance(g.measurement, tuple(GRIPS.values()))
    }
