"""A plan as one HTML file that opens offline: whether it is enough, and where the arms will be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from basecal.cell import Calibration, Cell, Sample
from basecal.errors import BasecalError
from basecal.planning.plan import Plan
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch
from basecal.planning.touches import with_marks
from basecal.reporting.cell_view.stage import stage, stated_scene
from basecal.reporting.decision.outlook import outlook_figure
from basecal.reporting.decision.tiles import Tile, error_tile
from basecal.reporting.plans.words import plan_headline, touch_lines
from basecal.reporting.statement.verdict import COLOURS, PLACE_WORDS, tangent_text
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
    """The plan as HTML, everything it needs inside; it asks nothing of any server.

    Args:
        cell: What it is for.
        plan: What to record.
        calibration: What it is based on; None if that is the cell alone.
        tolerance_m: The error that 95 of 100 are to stay below [m]; None if none is stated.
        title: What the reader calls it.
        steps: What to do with it, commands between backticks.
    """
    drawn: dict[str, Any] = {"scene_json": "", "head": (), "ways": ()}
    with suppress(BasecalError):  # of a cell without cameras nothing is drawn
        sketch = sketches(with_marks(cell, plan.marks), calibration)[0]
        drawn = stage(stated_scene(sketch, plan.samples))
        drawn["head"] = ["sample", *(f"{robot} goes" for robot in sketch.movers)]
        drawn["ways"] = list(_ways(sketch, plan.samples))
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


def _ways(sketch: Sketch, samples: tuple[Sample, ...]) -> Iterator[tuple[str, ...]]:
    """Path of each arm that carries something, from the sample before, by the number of each sample."""
    for before, after in zip((None, *samples), samples, strict=False):
        cells = [str(after.sample)]
        for robot in sketch.movers:
            if before is None or robot not in before.robots or robot not in after.robots:
                cells.append("")
                continue
            start, end = (sketch.base_from_flange(robot, each.robots[robot]) for each in (before, after))
            cells.append(tangent_text((start.inverse() @ end).log()))
        yield tuple(cells)
