"""Starts of targets with too few points per view for a pose, by their most visible point as a single LED.

In A X B = Y C Z, the rotations of X and Y are fixed on a grid. The directions to the LED then determine the
translations by linear least squares.
Source: docs/mathematics.md (6.5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.start.closed_form import Loop, Rotations, Triple, complete_loop
from basecal.estimation.start.pair_views import PairViews, led_point
from basecal.estimation.start.rotation_search import icosahedral_rotations
from basecal.geometry import SE3, Array

_RIDGE = 1e-6  # selects minimum-norm translations if views do not determine them
_MOST_VIEWS = 40  # maximum number of views that rank the cells of the grid
_BEST_CELLS = 8  # number of cells retained for each rotation of X


def led_search(pair: PairViews, loop: Loop, max_count: int) -> tuple[PairViews, Loop, list[Triple]]:
    """Reduce a pair to its most visible point as a single LED; return its views, its loop and the best starts.

    Args:
        pair: Views of a target, with at least one point each.
        loop: The known transforms among X, Y and Z.
        max_count: Maximum number of starts.
    """
    bearings, point = led_point(pair.group.measurement)
    views = np.flatnonzero(bearings.weight[:, point] > 0)
    group = pair.group.take(views)
    single = replace(bearings.take(views), points_in_target=np.zeros((1, 3)))
    single = replace(single, bearings_in_camera=single.bearings_in_camera[:, [point]], weight=single.weight[:, [point]])
    point_pair = replace(pair, group=replace(group, measurement=single), weight=pair.weight[views])
    led_z = None if loop.z is None else SE3(np.eye(3), loop.z @ bearings.points_in_target[point])
    led_loop = point_pair.loop(loop.x, loop.y, led_z, np.zeros(len(views), dtype=np.int64))
    return point_pair, led_loop, led_starts(led_loop, single.bearings_in_camera[:, 0], max_count)


def led_starts(loop: Loop, bearings_in_camera: Array, max_count: int) -> list[Triple]:
    """Find the best X, Y and Z for a single LED on the grid of rotations.

    Args:
        loop: Flange poses and known transforms; B is not used.
        bearings_in_camera: (n, 3) unit vectors towards the LED.
        max_count: Maximum number of starts, best first.
    """
    step = max(1, -(-len(loop.a) // _MOST_VIEWS))
    a, c, b = loop.a[::step], loop.c[::step], bearings_in_camera[::step]
    grid = icosahedral_rotations()
    xs = grid if loop.x is None else loop.x.rotation[None]
    ys = grid if loop.y is None else loop.y.rotation[None]
    scored: list[tuple[float, Array, Array, Array]] = []
    for x in xs:
        scored += _with_camera(loop, a, c, b, x, ys)
    scored.sort(key=lambda s: s[0])
    return [
        complete_loop(loop, Rotations(x, y, np.eye(3)), translations) for _, x, y, translations in scored[:max_count]
    ]


def _with_camera(loop: Loop, a: SE3, c: SE3, b: Array, x: Array, ys: Array) -> list[tuple[float, Array, Array, Array]]:
    """Scores, rotations of X and Y, and unknown translations of the best cells with one rotation of X."""
    direction = (a.rotation @ x @ b[..., None])[..., 0]
    projection = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    columns: dict[str, Array] = {}
    m, n = len(ys), len(b)
    hand_rotation = ys[:, None] @ c.rotation
    columns["x"] = np.broadcast_to(-a.rotation, (m, n, 3, 3))
    columns["y"] = np.broadcast_to(np.eye(3), (m, n, 3, 3))
    columns["z"] = hand_rotation
    constant = (ys[:, None] @ c.translation[..., None])[..., 0] - a.translation
    for name in "xyz":
        known = getattr(loop, name)
        if known is not None:
            constant = constant + (columns[name] @ known.translation[:, None])[..., 0]
    rows = np.concatenate([columns[name] for name in loop.unknown], -1)
    solution = _least_squares(projection, rows, constant)
    led_position = (rows @ solution[:, None, :, None])[..., 0] + constant
    depth = np.einsum("mni,ni->mn", led_position, direction)
    length = np.linalg.norm(led_position, axis=-1) + 1e-12
    score = np.mean(1 - depth / length, axis=-1)
    return [(float(score[k]), x, ys[k], solution[k]) for k in np.argsort(score)[:_BEST_CELLS]]


def _least_squares(projections: Array, rows: Array, constant: Array) -> Array:
    """Translations that minimise the distances of points from their lines of sight, (m, k)."""
    projected = projections @ rows
    flat = projected.reshape(len(rows), -1, rows.shape[-1])
    right = (projections @ constant[..., None]).reshape(len(rows), -1, 1)
    ridge = _RIDGE * len(projections) * np.eye(rows.shape[-1])
    normal = flat.mT @ flat + ridge
    return -np.asarray(np.linalg.solve(normal, flat.mT @ right)[..., 0], dtype=np.float64)
