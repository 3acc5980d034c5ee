"""Types of options of several verbs."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import fields, is_dataclass
from inspect import signature
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.errors import UsageError, list_names

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


def given_options(verb: Callable[..., int], values: Mapping[str, object]) -> list[str]:
    """Options of a verb whose values are not the defaults, such as `--task-point`.

    Args:
        verb: The function of the verb.
        values: Values by parameter, that is `locals()` at the start of the function.
    """
    names: list[str] = []
    for name, parameter in signature(verb).parameters.items():
        value = values[name]
        if is_dataclass(value):
            names += [each.name for each in fields(value) if getattr(value, each.name) != each.default]
        elif parameter.kind is parameter.KEYWORD_ONLY and value != parameter.default:
            names.append(name)
    return [f"--{name.replace('_', '-')}" for name in names]


def refuse_options(options: Iterable[str], exceptions: Container[str], reason: str) -> None:
    """Refuse options that have no effect.

    Args:
        options: The options, see `given_options`.
        exceptions: Options that have an effect.
        reason: Why the others have none.

    Raises:
        UsageError: if there are others; the message names them.
    """
    if unused := [option for option in options if option not in exceptions]:
        raise UsageError(f"{reason}: leave {list_names(unused)} out")


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
