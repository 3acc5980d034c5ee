"""Places as they are typed: numbers by themselves, or between one pair of quotes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

_OPTIONS = ("--task-point", "--task-box")

Point = tuple[float, float, float]
Box = tuple[float, float, float, float, float, float]


def numbers_apart(words: Iterable[str]) -> Iterator[str]:
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
