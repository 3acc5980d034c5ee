"""Sag of a lens in its holder: the image shifts along gravity, as if the camera rotated about its own centre.

A shift of the principal point by s pixels is equivalent to a rotation by s / f. Its axis is perpendicular to gravity
and the optical axis. The remaining difference is of second order in the field angle.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, mount_moves, one_candidate
from basecal.effects.faces.effect import AGAIN, Effect, ExpectedSize, FoundEffect, Words, format_with_sigma
from basecal.geometry import SE3, Array


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each camera on a moving robot, with its rotation under gravity perpendicular to its axis [rad]."""
    mounts = {group.camera: group.eye.mount for group in views.groups if group.eye.mount in views.mounts}
    for camera, mount in mounts.items():
        flange_from_camera = views.transform(mount)
        yield one_candidate(
            "lens-sag", camera, "rad", mount_moves(views, mount, partial(flange_tangents, flange_from_camera))
        )


def flange_tangents(flange_from_camera: SE3, down_in_flange: Array) -> Array:
    """Tangents of the flange that are equivalent to a unit sag, (n, 6, 1), from gravity in the flange, (n, 3)."""
    down = down_in_flange @ flange_from_camera.rotation
    turns = np.zeros((len(down), 6, 1))
    turns[:, 3, 0], turns[:, 4, 0] = down[:, 1], -down[:, 0]
    return flange_from_camera.adjoint() @ turns


def words(effect: FoundEffect) -> Words:
    """Describe the angle by which the lens's axis rotates."""
    size = format_with_sigma(1e3 * abs(float(effect.size[0])), 1e3 * effect.sigma)
    what = f"The lens of {effect.about} sags by {size} mrad in its holder."
    return Words("lens-sag", what, ("Lock the lens.", AGAIN))


EFFECT = Effect(
    "lens_sag",
    expected=ExpectedSize(3e-4, 3.0, "assumed: lenses that screw in shift images by half a pixel or two"),
    candidates=candidates,
    words=words,
    absent={
        "statement": "nobody measures it beforehand",
        "unknown": "the answer contains it as large as expected, given the data",
        "map": "the error map concerns poses of flanges, not of what they carry",
        "fault": "mount-bend of a camera looks nearly the same",
    },
)
