"""Drift: a base or a mount moved steadily from the first sample to the last."""

from __future__ import annotations

from collections.abc import Iterator

from basecal.effects.clock_drift import FEWEST_IN_TIME
from basecal.effects.faces.candidates import Candidates, Views, elapsed_share, frame_candidates
from basecal.effects.faces.effect import AGAIN, Effect, FoundEffect, Words, format_tangent


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: each base and mount with a tangent that grows linearly from the first sample to the last."""
    if len(views.samples) < FEWEST_IN_TIME:
        return
    for name in views.frames:
        yield frame_candidates("drift", views, name, elapsed_share(views)[:, None])


def words(effect: FoundEffect) -> Words:
    """Describe the drifting frame and its total motion."""
    motion = format_tangent(effect.size, effect.covariance)
    what = f"{effect.about} drifts{motion} from the first sample to the last."
    do = "Let robots and camera warm up.", "Look for a mount that creeps.", AGAIN
    return Words("drift", what, do)


EFFECT = Effect(
    "drift",
    candidates=candidates,
    words=words,
    is_in_time=True,
    absent={
        "statement": "a cell that drifts has no one answer",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "a cell that drifts has no one answer",
        "random": "in the noise models, neighbouring stops share errors by place, not by time",
        "map": "the widened covariance of the answer contains its effect",
        "fault": "recordings of the tests are drifted instead",
    },
)
