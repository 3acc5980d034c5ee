"""Causes of disagreement in words: what moved, what is off, and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from basecal.accuracy.drift.shifts import SIZE_KIND, Shift
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import describe_effect

_REPORTED = {"base-moved", "robot-model", "length-scale"}
_MOST_CAUSES = 3  # causes that are named where several explain the samples equally


def cause_of_shifts(causes: Sequence[Shift], sample: int) -> str:
    """The event at a sample, and the remedy.

    Args:
        causes: What explains the samples, the likeliest first.
        sample: Number of the first sample that has it.
    """
    named = list(dict.fromkeys(_describe_shift(each, sample) for each in causes))[:_MOST_CAUSES]
    return f"{', or '.join(named)}. Check what was bumped, loosened or exchanged, and capture again."


def _describe_shift(cause: Shift, sample: int) -> str:
    if cause.joint is not None:
        robot = cause.frame.removesuffix("_flange")
        return f"joint {cause.joint + 1} of {robot} slipped by {np.degrees(cause.shift_rad):.2g} deg at sample {sample}"
    if cause.transform == SIZE_KIND:
        percent = 100 * float(cause.size[0])
        larger = "larger" if percent > 0 else "smaller"
        return f"{cause.frame} is another board since sample {sample}, {abs(percent):.2g} % {larger}"
    size = f"{1e3 * cause.shift_m:.2g} mm and {np.degrees(cause.shift_rad):.2g} deg"
    verb = "moved" if cause.frame.endswith("_base") else "was remounted or moved"
    return f"{cause.frame} {verb} at sample {sample} by {size}"


def cause_of_error(error: FoundEffect) -> str | None:
    """The shared error of samples that noise does not explain, and the remedy; None if the report judges it."""
    words = describe_effect(replace(error, about=error.about.rpartition("_from_")[2]))
    return f"{words.what} {words.do[0]}" if words.code in _REPORTED else None
