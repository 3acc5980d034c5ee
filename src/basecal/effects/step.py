"""Step: a base or a mount moved suddenly at one of the samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views, frame_candidates
from basecal.effects.faces.effect import Effect, FoundEffect, Words, format_tangent
from basecal.geometry import IntArray
from basecal.numerics.batch import space_evenly

_MOST_SPLITS = 32  # tested samples at which a step may have occurred
_LEAST_SIDE = 3  # samples that depend on the frame, before and after its step


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each base and mount displaced by any tangent from one of the samples on."""
    for name in views.frames:
        splits = _splits(views, name)
        if len(splits):
            since = tuple(map(int, views.samples[splits]))
            is_moved = np.arange(len(views.samples))[:, None] >= splits
            yield frame_candidates("base-moved", views, name, is_moved, since)


def _splits(views: Views, name: str) -> IntArray:
    """Indices in `samples` of the tested first samples after a step of a frame."""
    ranks = np.unique(
        np.concatenate([views.sample_indices(g) for k, g in enumerate(views.groups) if views.depends(k, name)])
    )
    splits = ranks[_LEAST_SIDE : len(ranks) - _LEAST_SIDE + 1]
    return np.asarray(splits[space_evenly(len(splits), _MOST_SPLITS)], dtype=np.int64)


def words(effect: FoundEffect) -> Words:
    """Describe the moved frame, its displacement and the sample at which it moved."""
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
        "statement": "a cell is a different cell after a step",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "the parts of the recording are calibrated separately",
        "random": "each recording has one at most",
        "map": "verify looks for steps of new samples itself, see basecal.accuracy.drift.shifts",
    },
)
