"""Sag of a lens in its holder: the image shifts along gravity, as if the camera turned about its own centre.

A principal point that shifts by s pixels is a turn of s / f about the axis across gravity and the optical axis. What
remains is of second order in the angle of the field.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, mount_moves, one_candidate
from basecal.effects.faces.effect import AGAIN, Effect, ExpectedSize, FoundEffect, Words, format_with_sigma
from basecal.geometry import SE3, Array


def candidates(views: Views) -> Iterator[Candidates]:
    """Each camera on a robot that moves, by the turn of its axis where gravity is across it [rad]."""
    mounts = {group.camera: group.eye.mount for group in views.groups if group.eye.mount in views.mounts}
    for camera, mount in mounts.items():
        flange_from_camera = views.transform(mount)
        yield one_candidate(
            "lens-sag", camera, "rad", mount_moves(views, mount, partial(flange_tangents, flange_from_camera))
        )


def flange_tangents(flange_from_camera: SE3, down_in_flange: Array) -> Array:
    """How a camera's flange would move for the same, (n, 6, 1), by gravity in the flange, (n, 3)."""
    down = down_in_flange @ flange_from_camera.rotation
    turns = np.zeros((len(down), 6, 1))
    turns[:, 3, 0], turns[:, 4, 0] = down[:, 1], -down[:, 0]
    return flange_from_camera.adjoint() @ turns


def words(effect: FoundEffect) -> Words:
    """Words of the angle by which the lens's axis turns."""
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
        "map": "flanges meet at the task, not what they carry",
        "fault": "mount-bend of a camera looks nearly the same",
    },
)
