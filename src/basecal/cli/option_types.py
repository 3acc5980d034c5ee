"""Types of options of several verbs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.errors import UsageError

Point = tuple[float, float, float]
Box = tuple[float, float, float, float, float, float]


def number_range(low: float, high: float) -> Parameter:
    """A validator of numbers from `low` to `high`, inclusive."""
    return Parameter(validator=validators.Number(gte=low, lte=high))


Seed = Annotated[int, number_range(0, 2**63 - 1)]
Port = Annotated[int, number_range(0, 2**16 - 1)]
Domain = Annotated[int | None, number_range(0, 232)]
Output = Annotated[Path | None, Parameter(alias="-o")]
OpensPage = Annotated[bool, Parameter(name="--open")]
Names = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]


def task_points(point: Point | None, box: Box | None) -> list[Point]:
    """The task point, or the corners and the middle of the task box.

    Raises:
        UsageError: if neither is given, or both.
        InputError: if the box has no volume.
    """
    if point is not None and box is None:
        return [point]
    if point is not None or box is None:
        raise UsageError("give either --task-point x y z or --task-box x y z x y z, in the reference robot's base [m]")
    from basecal.accuracy.task.task import box_points
    from basecal.estimation.settings import Settings

    points = box_points(box)
    Settings(task_point=points[0], task_box=box)  # refuses a box without volume
    return points
