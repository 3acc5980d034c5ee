"""Places as they are typed: single numbers, or between one pair of quotes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from basecal.errors import UsageError

_OPTIONS = ("--task-point", "--task-box")

Point = tuple[float, float, float]
Box = tuple[float, float, float, float, float, float]


def split_numbers(words: Iterable[str]) -> Iterator[str]:
    """The words of a command, where `--task-point "0.8 -0.1 0.3"` is as `--task-point 0.8 -0.1 0.3`."""
    previous = ""
    for word in words:
        option, equals, value = word.partition("=")
        if previous in _OPTIONS:
            yield from word.replace(",", " ").split() or [word]
        elif equals and option in _OPTIONS:
            yield option
            yield from value.replace(",", " ").split()
        else:
            yield word
        previous = word


def task_points(point: Point | None, box: Box | None) -> list[Point]:
    """The point, or the corners and the middle of the box.

    Raises:
        UsageError: if neither is given, or both.
    """
    if point is not None and box is None:
        return [point]
    if point is not None or box is None:
        raise UsageError("give either --task-point x y z or --task-box x y z x y z, in the reference robot's base [m]")
    from basecal.accuracy.task.task import box_points

    return box_points(box)
