"""A plan in sentences: whether the tolerance is reached, with how many samples, and what forbids it."""

from __future__ import annotations

from collections.abc import Iterator

from numpy import degrees

from basecal.cell import TouchObservation
from basecal.geometry.euler import rpy_of_rotation
from basecal.planning.plan import Plan
from basecal.reporting.statement.verdict import PLACE_WORDS, Headline, two_digits


def plan_headline(plan: Plan, tolerance_m: float | None) -> Headline:
    """`PASS` or `FAIL` if a tolerance is stated, else `GOOD`; `DOUBTFUL` if fewer samples are planned than it needs."""
    expected = _error_words(plan)
    if tolerance_m is None:
        return Headline("GOOD", outcome(plan))
    needed = f"{1e3 * tolerance_m:.3g} mm {PLACE_WORDS[plan.place]}"
    if plan.reachable is False:
        source = f" The largest part of the error is {plan.budget[0].source}." if plan.budget else ""
        return Headline("FAIL", f"{needed} cannot be reached.{source}")
    if plan.needed == 0:
        with_recorded = f"{expected} with {plan.recorded} samples"
        return Headline("PASS", f"{needed} is already reached (95 %: {with_recorded}).")
    if plan.needed is not None and plan.needed > len(plan.samples):
        return Headline("DOUBTFUL", f"{needed} takes {plan.needed} samples, of which {len(plan.samples)} are planned.")
    return Headline("PASS", f"{needed}: {plan.needed} samples reach it.")


def outcome(plan: Plan) -> str:
    """Words of the planned samples' outcome."""
    count = len(plan.samples)
    many = f"{count} more samples" if plan.recorded else f"{count} samples"
    return f"Expected error with {many}: {_error_words(plan)} (95 %) {PLACE_WORDS[plan.place]}."


def plan_lines(plan: Plan, tolerance_m: float | None) -> Iterator[str]:
    """The headline's sentence, what the samples lead to, and the error by source, a line each."""
    first = plan_headline(plan, tolerance_m).sentence
    yield first
    if first != outcome(plan) and plan.samples:
        yield outcome(plan)
    yield from touch_lines(plan)
    for entry in plan.budget:
        halved = f"{two_digits(1e3 * entry.halved_rms_m)} mm rms in all with half of it"
        yield f"  {100 * entry.share:5.1f} % of the variance: {entry.source}; {halved}"


def touch_lines(plan: Plan) -> Iterator[str]:
    """Where to make a mark, and what to touch with which tip at which flange pose."""
    for name, place in plan.marks.items():
        yield f"Make a mark near ({', '.join(f'{number:.2f}' for number in place)}) m in the reference's base: {name}."
    for sample in plan.samples:
        for seen in (each for each in sample.observations if isinstance(each, TouchObservation)):
            (state,), how = sample.robots.values(), ""
            if state.base_from_flange is not None:
                angles = degrees(rpy_of_rotation(state.base_from_flange.rotation))
                how = f", flange turned by roll, pitch, yaw {', '.join(f'{angle:.0f}' for angle in angles)} deg"
            yield f"  touch {seen.mark} with {seen.tip}{how}"


def _error_words(plan: Plan) -> str:
    return "an unknown error" if plan.expected_m is None else f"{two_digits(1e3 * plan.expected_m)} mm"
