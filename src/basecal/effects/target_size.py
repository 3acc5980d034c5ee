"""Size of a target: the target is larger than stated by a fraction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, one_candidate
from basecal.effects.faces.effect import AGAIN, Effect, ExpectedSize, FoundEffect, Words, format_with_sigma
from basecal.geometry import Array

NAME = "target_size"
EXPECTED = ExpectedSize(5e-4, 1.0, "assumed: a print measured by a caliper, to 0.1 mm over 200 mm", is_stated=True)


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each target with a relative error of its size."""
    for target in views.targets:
        moves = (size_moves(views, k) if g.target == target else None for k, g in enumerate(views.groups))
        yield one_candidate("length-scale", target, "", tuple(moves))


def size_moves(views: Views, k: int) -> Array:
    """Derivatives of a group's views with respect to the relative size of their target, (n, 6, 1).

    A target that is larger than stated appears nearer than it is, since its image is larger.
    """
    nearer = np.zeros((len(views.groups[k]), 6, 1))
    nearer[:, :3] = views.target_from_camera(k).translation[..., None]
    return nearer


def words(effect: FoundEffect) -> Words:
    """Describe by how much a target is larger or smaller than stated."""
    percent = 100 * effect.size[0]
    amount = f"{format_with_sigma(abs(percent), 100 * effect.sigma)} %"
    what = f"{effect.about} is {amount} {'larger' if percent > 0 else 'smaller'} than stated."
    return Words("length-scale", what, ("Measure its print.", AGAIN))


EFFECT = Effect(
    NAME,
    expected=EXPECTED,
    candidates=candidates,
    words=words,
    elsewhere={"statement": "basecal.cell.targets: the lengths of each kind"},
    absent={
        "unknown": "a ruler measures it better than views of arms with equal relative errors of length",
        "map": "the widened covariance of the answer contains its effect",
        "fault": "link-errors of both arms look the same; `study` varies the stated size",
    },
)
