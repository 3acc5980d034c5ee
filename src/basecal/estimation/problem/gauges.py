"""Gauges: changes of a robot's parameters that the recorded joints do not distinguish from changes of other unknowns.

The offset of a joint that never moved has the effect of a rotation of the base. The same is true of the next joint.
The offset of the last joint has the effect of a rotation of the mounts on the flange. A rotation about a joint's own
axis is the joint's offset. Which of these a recording leaves open depends on the recorded flange poses, not on the arm
alone. No view depends on a plate's rotation about the line of its marks, or on a plane's motion within itself. Source:
docs/mathematics.md, "Gauges".
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

# RMS motion of the flange per radian of a parameter [rad], below which it may be due to noise of the recorded poses:
# real arms have some milliradians.
LEAST_RMS_RAD = 3e-3
LENGTH_M = 0.5  # length equivalent to one radian: a typical lever arm of an arm's flange [m]
MOVE_SCALE = np.array([LENGTH_M] * 3 + [1.0] * 3)
_SHARE_DECIMALS = 6  # decimals of a joint's share in a gauge: rounding errors must not decide between equal shares


def end_moves(base_from_flange: SE3, free_ends: tuple[bool, bool]) -> Array:
    """Derivatives of flange poses with respect to the free ends of the arm, right tangents, (m, 6, k).

    Args:
        base_from_flange: (m,) flange poses.
        free_ends: Whether the base is free, and whether everything on the flange is free.
    """
    at_base, at_flange = base_from_flange.inverse().adjoint(), np.broadcast_to(np.eye(6), (len(base_from_flange), 6, 6))
    ends = [adjoint * MOVE_SCALE for adjoint, free in zip((at_base, at_flange), free_ends, strict=True) if free]
    return np.concatenate([np.zeros((len(base_from_flange), 6, 0)), *ends], axis=-1)


def independent_moves(moves: Array, other_moves: Array) -> Spectrum:
    """Spectrum of the mean squared flange motions that other motions cannot absorb [rad^2].

    Args:
        moves: (m, 6, k) right tangents per unit of each parameter [m, rad].
        other_moves: (m, 6, j) right tangents per unit of each other parameter [m, rad].
    """
    rows, other_rows = _flatten_moves(moves), _flatten_moves(other_moves)
    absorbed = scaled_spectrum(other_rows.T @ other_rows, LEAST_RMS_RAD**2).inverse_root.T @ (other_rows.T @ rows)
    return scaled_spectrum(rows.T @ rows - absorbed.T @ absorbed, LEAST_RMS_RAD**2)


def _flatten_moves(moves: Array) -> Array:
    """Scale motions (m, 6, k) to rows (6 m, k) [rad]: 0.5 m equals 1 rad, sums of squares are means over flanges."""
    rows = moves / MOVE_SCALE[:, None]
    return np.asarray(rows.reshape(6 * len(moves), moves.shape[-1]) / np.sqrt(max(len(moves), 1)))


def determined_directions(moves: Array, other_moves: Array) -> Array:
    """Orthonormal basis, (k, r), of the moves that other moves cannot absorb; see `independent_moves`."""
    spectrum = independent_moves(moves, other_moves)
    return np.asarray(spectrum.vectors[:, spectrum.is_informative])


def determined_joints(moves: Array, other_moves: Array) -> IntArray:
    """Indices of the joints to estimate; the others are held, so that no gauge is left with the other moves.

    `moves` has one column per joint. If joints have equal shares in a gauge, the first is held.
    """
    spectrum = independent_moves(moves, other_moves)
    gauges, held = spectrum.vectors[:, ~spectrum.is_informative], list[int]()
    for _ in range(gauges.shape[1]):
        share = np.round(np.linalg.norm(gauges, axis=-1), _SHARE_DECIMALS)
        held.append(int(np.argmax(share)))
        direction = gauges[held[-1]] / np.linalg.norm(gauges[held[-1]])
        gauges = gauges - np.outer(gauges @ direction, direction)
    return np.setdiff1d(np.arange(moves.shape[-1]), np.array(held, dtype=np.int64))


def held_gauges(cell: Cell, groups: Sequence[ViewGroup]) -> dict[str, Array]:
    """Held tangent directions of transforms that are not fixed, by name, (6,): 1 if held, else 0."""
    gauges = {cell.plate_name(plate): _line_rotation(cell, plate) for plate in cell.plates}
    for group in groups:
        if isinstance(group.measurement, ContactMeasurement):
            gauges[group.eye.mount] = np.array(group.measurement.camera_gauge, dtype=np.float64)
            gauges[group.hand.mount] = np.array(group.measurement.target_gauge, dtype=np.float64)
    unknowns = cell.transforms
    return {name: gauge for name, gauge in gauges.items() if gauge.any() and unknowns[name].status != "fixed"}


def _line_rotation(cell: Cell, plate: str) -> Array:
    """Held directions of a plate, (6,): the rotation about the line of its marks; zero if the marks span a plane."""
    marks = [target.mount.mean for target in cell.targets.values() if target.on == plate]
    points = np.array([mark.translation for mark in marks if mark is not None])
    principal, held = principal_axes(points - points.mean(0)), np.zeros(6)
    if principal.dimension == 1:
        held[3 + int(np.argmax(np.abs(principal.axes[:, 0])))] = 1.0
    return held


def point_mounts(cell: Cell, groups: Sequence[ViewGroup]) -> frozenset[str]:
    """Names of the mounts of single points, except points measured as poses, whose orientation matters.

    Raises:
        InputError: if a point that was measured as poses is also observed as a point, or its mount is not free.
    """
    points = {t.name for t in cell.targets.values() if t.target is not None and t.target.is_point}
    observed_as_poses = {g.target for g in groups if isinstance(g.measurement, PoseMeasurement)} & points
    observed_as_points = {g.target for g in groups if not isinstance(g.measurement, PoseMeasurement)}
    for target in sorted(observed_as_poses):
        if target in observed_as_points or cell.targets[target].mount.status != "free":
            raise InputError(
                f"target {target!r} is one point, which has no orientation, and is observed by `camera_from_target`. "
                "Leave out its `kind` and state its mount with a rotation. Views of the point itself are of another "
                "target"
            )
    return frozenset(map(cell.mount_name, (points - observed_as_poses) | _tips(groups)))


def _tips(groups: Sequence[ViewGroup]) -> set[str]:
    """Names of tips that only touch points with their origin: the rotations of their mounts have no effect."""
    return {g.camera for g in groups} - {
        g.camera for g in groups if not is_touch(g.measurement) or isinstance(g.measurement, tuple(GRIPS.values()))
    }
