"""Step: a base or a mount moved at one of the samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.effect import Effect
from basecal.effects.faces.found_effect import FoundEffect, Words, rounded_tangent
from basecal.effects.faces.views import Views
from basecal.geometry import Array

_MOST_SPLITS = 32  # of a recording in time at which a step is looked for
_LEAST_SIDE = 3  # samples before and after a step


def candidates(views: Views) -> Iterator[Candidates]:
    """Each base and mount moved at one of the samples, by any tangent."""
    count = len(views.samples)
    splits = np.arange(_LEAST_SIDE, count - _LEAST_SIDE + 1)
    splits = splits[np.unique(np.linspace(0, len(splits) - 1, min(_MOST_SPLITS, len(splits))).astype(int))]
    if not len(splits):
        return
    since = tuple(int(views.samples[s]) for s in splits)

    def step_moves(k: int, name: str) -> Array | None:
        """How views of a group move, (n, splits, 6, 6)."""
        if not views.depends(k, name):
            return None
        is_after = views.rank(views.groups[k])[:, None] >= splits
        return np.asarray(is_after[..., None, None] * views.frame_jacobian(k, name)[:, None])

    for name in views.frames:
        moves = tuple(step_moves(k, name) for k in range(len(views.groups)))
        yield Candidates("base-moved", (name,) * len(splits), since, "", moves)


def words(effect: FoundEffect) -> Words:
    """What moved, by how much and when."""
    what = f"{effect.about} moved by {rounded_tangent(effect.size, effect.covariance)} at about sample {effect.since}."
    do = "Check what was bumped, loosened or exchanged there.", "Calibrate the parts of the recording separately."
    return Words("base-moved", what, do)


EFFECT = Effect(
    "step",
    candidates=candidates,
    words=words,
    elsewhere={"fault": "basecal.simulation.running.faults: base-bumped, board-remounted"},
    absent={
        "statement": "a cell that is moved is another cell",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "the parts of the recording are calibrated separately",
        "random": "each recording has one at most",
        "map": "verify looks for steps of new samples itself, see basecal.accuracy.drift.shifts",
    },
)
