"""Fixed transform: a base or a mount that is stated as fixed, but differs from its statement in all samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, frame_candidates
from basecal.effects.faces.effect import AGAIN, FIX, Effect, FoundEffect, Words, format_tangent
from basecal.geometry import Array

CODE = "fixed-contradicted"


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each fixed base and mount with any tangent."""
    for name in views.fixed_frames:
        yield frame_candidates(CODE, views, name, np.ones((len(views.samples), 1)))


def words(effect: FoundEffect) -> Words:
    """Describe the error of a fixed transform."""
    return Words(CODE, *disagreement(effect.about, effect.size, effect.covariance))


def disagreement(name: str, size: Array, covariance: Array) -> tuple[str, tuple[str, ...]]:
    """Describe the error of a fixed transform, and its remedy.

    Args:
        name: Name of the transform.
        size: (6,) tangent from the stated to the estimated transform [m, rad]; (3,) shift of a point [m].
        covariance: (6, 6) or (3, 3) of the size.
    """
    frame = name.rpartition("_from_")[2]
    stated = f"base of {frame.removesuffix('_base')}" if frame.endswith("_base") else f"mount of {frame}"
    what = f"The stated {stated} disagrees with the data{format_tangent(size, covariance)}."
    return what, (f"Measure {name} again, or state it as a prior with its sigmas.", AGAIN, FIX)


EFFECT = Effect(
    "fixed_transform",
    candidates=candidates,
    words=words,
    elsewhere={"statement": "basecal.cell.schema: status, with the sigmas of a prior", "unknown": "basecal.estimation"},
    absent={
        "size": "a candidate without a prior: only a certain one is reported",
        "random": "each cell states one",
        "map": "the widened covariance of the answer contains its effect",
        "fault": "base-bumped and board-remounted move one from the first sample on, given @0",
    },
)
