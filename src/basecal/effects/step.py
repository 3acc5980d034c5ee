"""Step: a base or a mount moved at one of the samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.effect import Effect
from basecal.effects.faces.found_effect import FoundEffect, Words, format_tangent
from basecal.effects.faces.views import Views, frame_moves
from basecal.geometry import Array, BoolArray, IntArray

_MOST_SPLITS = 32  # of a recording in time at which a step is looked for
_LEAST_SIDE = 3  # samples that see a frame before and after its step


def candidates(views: Views) -> Iterator[Candidates]:
    """Each base and mount moved at one of the samples, by any tangent."""
    for name in views.frames:
        splits = _splits(views, name)
        if len(splits):
            since = tuple(map(int, views.samples[splits]))
            yield split_frame(views, name, np.arange(len(views.samples))[:, None] >= splits, since)


def split_frame(views: Views, name: str, is_moved: BoolArray, first_samples: tuple[int | None, ...]) -> Candidates:
    """A frame that is elsewhere in some samples, by any tangent, (samples, b) whether in each of them."""

    def moves(k: int) -> Array | None:
        """How views of a group move, (n, b, 6, q)."""
        by_frame = frame_moves(views, k, name)
        moved = is_moved[views.rank(views.groups[k])][..., None, None]
        return None if by_frame is None else np.asarray(moved * by_frame[:, None])

    return Candidates(
        "base-moved", (name,) * len(first_samples), first_samples, "", tuple(map(moves, range(len(views.groups))))
    )


def _splits(views: Views, name: str) -> IntArray:
    """Indices in `samples` of those that may be the first to see a frame elsewhere."""
    seen = np.unique(np.concatenate([views.rank(g) for k, g in enumerate(views.groups) if views.depends(k, name)]))
    splits = seen[_LEAST_SIDE : len(seen) - _LEAST_SIDE + 1]
    chosen = np.unique(np.linspace(0, len(splits) - 1, min(_MOST_SPLITS, len(splits))).astype(int))
    return np.asarray(splits[chosen], dtype=np.int64)


def words(effect: FoundEffect) -> Words:
    """Words of the moved frame, its shift and its time."""
    what = f"{effect.about} moved{format_tangent(effect.size, effect.covariance)} at about sample {effect.since}."
    do = "Check what was bumped, bent, loosened or exchanged there.", "Calibrate the parts of the recording separately."
    return Words("base-moved", what, do)


EFFECT = Effect(
    "step",
    candidates=candidates,
    words=words,
    is_in_time=True,
    elsewhere={"fault": "basecal.simulation.running.faults: base-bumped, board-remounted"},
    absent={
        "statement": "a cell that is moved is another cell",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "the parts of the recording are calibrated separately",
        "random": "each recording has one at most",
        "map": "verify looks for steps of new samples itself, see basecal.accuracy.drift.shifts",
    },
)
