"""Play of a mount: a camera or a target slides in its holder, or the holder yields, under its weight.

The translation is T g, with g the direction of gravity in the flange and any 3x3 matrix T. Examples are a slide along
an axis, a spring, and a bend about a point away from the flange. T has no trace: a translation along gravity that is
equal at all poses is an unobservable shift of the base. Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, mount_moves, one_candidate
from basecal.effects.faces.effect import (
    AGAIN,
    MILLI,
    Effect,
    ExpectedSize,
    FoundEffect,
    SimulatedFault,
    Words,
    format_length,
)
from basecal.effects.mount_bend import ABSENT
from basecal.geometry import Array
from basecal.geometry.rotation import cross_matrix


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each mount on a moving robot, with the coefficients of T [m]."""
    for mount in views.mounts:
        yield one_candidate("mount-play", mount, "m", mount_moves(views, mount, flange_tangents))


def flange_tangents(down_in_flange: Array) -> Array:
    """Derivatives of a mount with respect to the coefficients, (n, 6, 8), flange tangents, from gravity, (n, 3)."""
    shifts = np.einsum("kij,nj->nik", _MATRICES, down_in_flange)
    return np.concatenate([shifts, np.zeros_like(shifts)], axis=1)


def _matrices() -> Array:
    """An orthogonal basis of the traceless 3x3 matrices, all of the same norm, (8, 3, 3)."""
    off_diagonal = np.abs(cross_matrix(np.eye(3)))
    diagonal = np.array([np.diag([1.0, -1.0, 0.0]), np.diag([1.0, 1.0, -2.0]) / np.sqrt(3)])
    return np.concatenate([cross_matrix(np.eye(3)), off_diagonal, diagonal])


_MATRICES = _matrices()


def words(effect: FoundEffect) -> Words:
    """Describe the play as root mean square over directions of gravity."""
    size = format_length(effect.size, effect.covariance, 1e3 * (2 / 3) ** 0.5)
    what = f"{effect.about} shifts by {size} mm under gravity."
    return Words("mount-play", what, ("Fasten what it holds without play.", AGAIN))


def slide(size_m: float, down_in_flange: Array) -> Array:
    """Tangent of the flange, (6,), of a mount that slides along x by up to `size_m`."""
    return np.array([size_m * down_in_flange[0], 0.0, 0.0, 0.0, 0.0, 0.0])


EFFECT = Effect(
    "mount_play",
    expected=ExpectedSize(6e-5, 3.0, "assumed: clamps and slides give 0.02 to 0.5 mm"),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "mount-play", "mm", MILLI, 0.5, "mounts slide along x of the flange under gravity", move_mount=slide
    ),
    absent=ABSENT,
)
