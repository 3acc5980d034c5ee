"""Bend of a mount: the weight of a camera or a target rotates the bracket that holds it on its flange.

The rotation is l x g, with g the direction of gravity in the flange. If the load of a bracket is at the end of a lever,
l is along that lever. The length of l is the rotation under gravity perpendicular to the lever. To first order the bend
acts as a tilt of the base. Source: docs/mathematics.md (11.4).
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
    Face,
    FoundEffect,
    SimulatedFault,
    Words,
    format_length,
)
from basecal.geometry import Array
from basecal.geometry.rotation import cross_matrix


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each mount on a moving robot, with the vector l [rad]."""
    for mount in views.mounts:
        yield one_candidate("mount-bent", mount, "rad", mount_moves(views, mount, flange_tangents))


def flange_tangents(down_in_flange: Array) -> Array:
    """Derivatives of a mount with respect to l, (n, 6, 3), tangents of the flange, from gravity in it, (n, 3)."""
    tangents = np.zeros((len(down_in_flange), 6, 3))
    tangents[:, 3:] = -cross_matrix(down_in_flange)
    return tangents


def words(effect: FoundEffect) -> Words:
    """Describe the angle by which the mount bends under gravity perpendicular to its lever."""
    size = format_length(effect.size, effect.covariance, 1e3)
    what = f"{effect.about} bends by {size} mrad under gravity."
    do = "Stiffen what holds it, or fasten its load nearer to the flange.", AGAIN
    return Words("mount-bent", what, do)


def bend(size_rad: float, down_in_flange: Array) -> Array:
    """Tangent of the flange, (6,), of a mount whose lever is along z and bends by `size_rad`."""
    return np.asarray(flange_tangents(down_in_flange[None])[0, :, 2] * size_rad)


ABSENT: dict[Face, str] = {
    "statement": "nobody measures it beforehand",
    "unknown": "the answer contains it as large as expected, given the data",
    "map": "the error map concerns poses of flanges, not of what they carry",
}
"""Faces that effects of gravity on a mount lack, with the reason."""

EFFECT = Effect(
    "mount_bend",
    expected=ExpectedSize(3e-4, 3.0, "assumed: brackets of sheet metal and printed plastic bend by 0.1 to 1 mrad"),
    candidates=candidates,
    words=words,
    fault=SimulatedFault(
        "mount-bend", "mrad", MILLI, 1.0, "mounts bend if gravity is perpendicular to z of the flange", move_mount=bend
    ),
    absent=ABSENT,
)
