"""A plan as one HTML file that opens offline: the expected error, and the poses of the arms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from numpy import degrees

from basecal.cell import Calibration, Cell, Sample, TouchObservation
from basecal.errors import BasecalError, count_text
from basecal.fields.digits import two_digits
from basecal.planning.plan import Plan
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch
from basecal.planning.touches import with_marks
from basecal.reporting.cell_view.stage import scene_values, stated_scene
from basecal.reporting.decision.outlook import outlook_figure
from basecal.reporting.decision.tiles import Tile, error_tile
from basecal.reporting.statement.verdict import COLOURS, PLACE_WORDS, Headline, tangent_text
from basecal.reporting.templates.environment import fill_page


def plan_page(
    cell: Cell,
    plan: Plan,
    calibration: Calibration | None,
    tolerance_m: float | None,
    *,
    title: str,
    steps: Sequence[str],
) -> str:
    """The plan as a self-contained HTML page without external requests.

    Args:
        cell: The cell.
        plan: The plan.
        calibration: The calibration that it is based on; None if it is based on the cell only.
        tolerance_m: Tolerance for 95 % of errors [m]; None if none is given.
        title: Title of the page.
        steps: Next steps, with commands between backticks.
    """
    drawn: dict[str, Any] = {"scene_json": "", "head": (), "ways": ()}
    with suppress(BasecalError):  # a cell without cameras is not drawn
        sketch = sketches(with_marks(cell, plan.marks), calibration)[0]
        drawn = scene_values(stated_scene(sketch, plan.samples))
        drawn["head"] = ["sample", *(f"motion of {robot}" for robot in sketch.movers)]
        drawn["ways"] = list(_motion_rows(sketch, plan.samples))
    first = plan_headline(plan, tolerance_m)
    return fill_page(
        "plan.html",
        ("templates/copies.js", "templates/page.js"),
        title=title,
        first=first,
        colour=COLOURS[first.word],
        tiles=list(_tiles(plan, tolerance_m)),
        steps=[*steps, *touch_lines(plan)] if plan.samples else (),
        outlook=outlook_figure(plan.steps, plan.recorded, tolerance_m) if len(plan.steps) > 1 else None,
        budget=plan.budget,
        place=PLACE_WORDS[plan.place],
        **drawn,
    )


def _tiles(plan: Plan, tolerance_m: float | None) -> Iterator[Tile]:
    if plan.expected_m is not None:
        yield error_tile(plan.expected_m, tolerance_m)
    yield Tile(str(len(plan.samples)), "samples to record")
    yield Tile(str(plan.recorded), "samples recorded")


def _motion_rows(sketch: Sketch, samples: tuple[Sample, ...]) -> Iterator[tuple[str, ...]]:
    """Rows of a table: the number of each sample, and each arm's motion from the previous sample."""
    for previous, sample in zip((None, *samples), samples, strict=False):
        cells = [str(sample.sample)]
        for robot in sketch.movers:
            if previous is None or robot not in previous.robots or robot not in sample.robots:
                cells.append("")
                continue
            start, end = (sketch.base_from_flange(robot, each.robots[robot]) for each in (previous, sample))
            cells.append(tangent_text((start.inverse() @ end).log()))
        yield tuple(cells)


def plan_headline(plan: Plan, tolerance_m: float | None) -> Headline:
    """`PASS` or `FAIL` if a tolerance is given, else `GOOD`; `DOUBTFUL` if fewer samples are planned than needed."""
    expected = _error_words(plan)
    if tolerance_m is None:
        return Headline("GOOD", outcome(plan))
    needed = f"{1e3 * tolerance_m:g} mm {PLACE_WORDS[plan.place]}"
    if plan.reachable is False:
        source = f" The largest part of the error is {plan.budget[0].source}." if plan.budget else ""
        return Headline("FAIL", f"{needed} cannot be reached.{source}")
    if plan.needed == 0:
        with_recorded = f"{expected} with {count_text(plan.recorded, 'sample')}"
        return Headline("PASS", f"{needed} is already reached (95 %: {with_recorded}).")
    if plan.needed is not None and plan.needed > len(plan.samples):
        return Headline(
            "DOUBTFUL", f"{needed} takes {count_text(plan.needed, 'sample')}, of which {len(plan.samples)} are planned."
        )
    verb = "reaches" if plan.needed == 1 else "reach"
    return Headline("PASS", f"{needed}: {count_text(plan.needed or 0, 'sample')} {verb} it.")


def outcome(plan: Plan) -> str:
    """Sentence with the expected error after the planned samples."""
    count = len(plan.samples)
    many = count_text(count, "more sample" if plan.recorded else "sample")
    return f"Expected error with {many}: {_error_words(plan)} (95 %) {PLACE_WORDS[plan.place]}."


def plan_lines(plan: Plan, tolerance_m: float | None) -> Iterator[str]:
    """Lines of the headline, the expected error, the touches, and the error by source."""
    first = plan_headline(plan, tolerance_m).sentence
    yield first
    if first != outcome(plan) and plan.samples:
        yield outcome(plan)
    yield from touch_lines(plan)
    for entry in plan.budget:
        halved = f"total {two_digits(1e3 * entry.halved_rms_m)} mm rms if halved"
        yield f"  {100 * entry.share:5.1f} % of the variance: {entry.source}; {halved}"


def touch_lines(plan: Plan) -> Iterator[str]:
    """Lines with the positions of new marks, and the touches with tip, mark and flange orientation."""
    for name, position in plan.marks.items():
        coordinates = ", ".join(f"{number:.2f}" for number in position)
        yield f"Make a mark near ({coordinates}) m in the reference's base: {name}."
    for sample in plan.samples:
        for touch in (each for each in sample.observations if isinstance(each, TouchObservation)):
            (state,), orientation = sample.robots.values(), ""
            if state.base_from_flange is not None:
                angles = degrees(state.base_from_flange.rpy)
                orientation = f", flange turned by roll, pitch, yaw {', '.join(f'{angle:.0f}' for angle in angles)} deg"
            yield f"  touch {touch.mark} with {touch.tip}{orientation}"


def _error_words(plan: Plan) -> str:
    return "an unknown error" if plan.expected_m is None else f"{two_digits(1e3 * plan.expected_m)} mm"
