"""Clock drift: a clock offset that grows linearly with time and is zero in the middle of the recording."""

from __future__ import annotations

from collections.abc import Iterator

from basecal.effects.clock_offset import delay_moves, is_late
from basecal.effects.faces.candidates import Candidates, Views, elapsed_share, one_candidate
from basecal.effects.faces.effect import AGAIN, Effect, FoundEffect, Words, format_with_sigma

FEWEST_IN_TIME = 6
"""Fewest samples in which a drift is looked for."""


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: the clocks of `clock_offset`, each with a change of its offset from the first sample to the last."""
    if not views.has_times or len(views.samples) < FEWEST_IN_TIME:
        return
    share = elapsed_share(views) - 0.5
    for name, late in delay_moves(views):
        groups = views.groups
        moves = (
            None if m is None else share[views.sample_indices(g)][:, None, None] * m
            for g, m in zip(groups, late, strict=True)
        )
        yield one_candidate("clock-drift", name, "s", tuple(moves))


def words(effect: FoundEffect) -> Words:
    """Describe the clock drift of a device and its amount."""
    amount = format_with_sigma(abs(1e3 * effect.size[0]), 1e3 * effect.sigma)
    kind, relation = "images" if effect.is_camera else "poses", "fall behind" if is_late(effect) else "run ahead of"
    what = (
        f"The clock of {effect.about} drifts: its {kind} {relation} the other devices by {amount} ms "
        "from first to last sample."
    )
    return Words(
        "clock-offset", what, ("Synchronise the clocks, as by PTP or NTP, or record for a shorter time.", AGAIN)
    )


EFFECT = Effect(
    "clock_drift",
    candidates=candidates,
    words=words,
    absent={
        "statement": "clocks that drift are to be synchronised, which no statement replaces",
        "size": "a candidate without a prior: only a certain one is reported",
        "unknown": "only a constant offset is estimated; a recording with drift is to be repeated",
        "random": "jitter of stamps contains a small one",
        "map": "the widened covariance of the answer contains its effect",
        "fault": "clocks of the simulator run at one rate; recordings of its tests are drifted instead",
    },
)
